"""Files that a user names: whether there is one, before anything heavy is loaded to read it."""

from __future__ import annotations

from pathlib import Path

from luxcore.errors import InputError


def check_input_file(path: Path) -> None:
    """Raises InputError when `path` is a folder, or nothing at all."""
    path = Path(path)
    if path.is_dir():
        raise InputError(f"{path} is a folder, not a file.")
    if not path.is_file():
        raise InputError(f"{path} does not exist.")
