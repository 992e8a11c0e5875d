"""Names from outside: ids that become folder names, paths that must stay in their folder."""

from __future__ import annotations

import re
from pathlib import Path

from luxcore.errors import FormatError, InputError

_ID = re.compile(r"[a-z0-9_-]{1,64}")
_MAX_NAME = 255


def check_id(identifier: str) -> str:
    """`identifier` when it is 1–64 of a–z, 0–9, _ and -; InputError otherwise."""
    if not isinstance(identifier, str) or not _ID.fullmatch(identifier):
        raise InputError(
            f"the id {identifier!r:.80} must be 1 to 64 characters of a-z, 0-9, _ and -."
        )
    return identifier


def inside(root: Path, name: str, origin: Path) -> Path:
    """The path `name` under `root`; FormatError when it is absolute, climbs out or is malformed.

    `origin` is the file that named it, for the message.
    """
    parts = name.split("/") if isinstance(name, str) else []
    malformed = not parts or any(len(p) > _MAX_NAME or p in ("", "..") for p in parts)
    if malformed or "\0" in name or "\\" in name or Path(name).is_absolute():
        raise FormatError(f"{origin} names a file outside its folder or malformed: {name!r:.80}.")
    path = (Path(root) / name).resolve()
    if not path.is_relative_to(Path(root).resolve()):
        raise FormatError(f"{origin} names a file outside its folder: {name!r:.80}.")
    return path
