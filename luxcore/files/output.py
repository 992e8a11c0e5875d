"""Folders that a command writes for its user: nothing of theirs is ever replaced."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path

from luxcore.errors import InputError


def check_out_folder(out: Path, names: Sequence[str] = (), mark: str | None = None) -> None:
    """Refuse, before any work, to replace what an earlier call did not write.

    `names` are patterns of what the command writes into `out`. An empty folder may be replaced, and
    one that holds nothing but such names, the file `mark` among them where one is named; a file, a
    folder with anything else in it, and one that the caller stands in may not. Raises InputError.
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; name a folder.")
    if not out.is_dir():
        return
    if out.resolve() in (Path.cwd(), *Path.cwd().parents):
        raise InputError(f"{out} is the folder that you are in; name a new one.")
    held = sorted(p.name for p in out.iterdir())
    earlier = mark is None or mark in held
    others = [n for n in held if not (earlier and any(fnmatch(n, name) for name in names))]
    if others:
        raise InputError(f"{out} holds {others[0]}, which would be lost; name a new folder.")
