"""Folders that a command writes for its user: nothing of theirs is ever replaced."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path

from luxcore.errors import InputError


def check_out_folder(out: Path, names: Sequence[str]) -> None:
    """Refuse, before any work, to replace what an earlier call did not write.

    `names` are patterns of what the command writes into `out`. A folder that holds only such names
    may be replaced; a file, a folder with anything else in it, and one that the caller stands in
    may not. Raises InputError.
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; name a folder.")
    if not out.is_dir():
        return
    if out.resolve() in (Path.cwd(), *Path.cwd().parents):
        raise InputError(f"{out} is the folder that you are in; name a new one.")
    others = (p.name for p in out.iterdir() if not any(fnmatch(p.name, n) for n in names))
    if (other := min(others, default=None)) is not None:
        raise InputError(f"{out} holds {other}, which would be lost; name a new folder.")
