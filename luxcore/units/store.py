"""The unit store: finished units on disk by key, each with a manifest of its files' sha256."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from luxcore.files.atomic import atomic_folder
from luxcore.files.digests import file_digest, tree_digest, value_digest

MANIFEST = "manifest.json"
_PROJECT = Path(__file__).resolve().parents[2]


def unit_key(code: Iterable[str], arguments: dict[str, Any], inputs: Iterable[str] = ()) -> str:
    """sha256 of the code version, the parameters and the inputs' digests.

    `code` are files or folders relative to the project root whose change makes the unit stale.
    """
    sources = [_PROJECT / path for path in sorted(code)]
    return value_digest([tree_digest(sources, _PROJECT), arguments, list(inputs)])


class UnitStore:
    """Folders named by key under `root`. A unit is whole and verified, or absent."""

    def __init__(self, root: Path) -> None:
        self.root = Path(root)

    def path(self, key: str) -> Path:
        """Where the unit of `key` is or would be."""
        return self.root / key[:2] / key

    def has(self, key: str) -> bool:
        """Whether the unit was finished; its bytes are not read (see `get`)."""
        return (self.path(key) / MANIFEST).is_file()

    def get(self, key: str) -> Path | None:
        """The unit's folder, verified against its manifest; a damaged unit is removed."""
        folder = self.path(key)
        if not self.has(key):
            return None
        if damaged_files(folder):
            shutil.rmtree(folder, ignore_errors=True)
            return None
        return folder

    def put(self, key: str, write: Callable[[Path], None]) -> Path:
        """Let `write` fill a temporary folder; it becomes the unit only when all is on disk."""
        folder = self.path(key)
        with atomic_folder(folder) as temporary:
            write(temporary)
            seal_folder(temporary)
        return folder

    def clear_leftovers(self, key: str) -> None:
        """Remove what a process that was killed left of this unit; none may be at work on it."""
        folder = self.path(key)
        for temporary in folder.parent.glob(f".{folder.name}-*"):
            shutil.rmtree(temporary, ignore_errors=True)


def seal_folder(folder: Path) -> None:
    """Write the manifest: relative name → sha256 of every file in `folder`."""
    files = {str(f.relative_to(folder)): file_digest(f) for f in _data_files(folder)}
    (folder / MANIFEST).write_text(json.dumps(files, indent=1, sort_keys=True) + "\n")


def damaged_files(folder: Path) -> list[str]:
    """Names that the manifest lists and that are missing or hold other bytes."""
    try:
        files = json.loads((folder / MANIFEST).read_text())
        items = sorted(files.items())
    except (OSError, ValueError, AttributeError):
        return [MANIFEST]
    return [name for name, digest in items if not _holds(folder / name, digest)]


def _holds(path: Path, digest: str) -> bool:
    return path.is_file() and file_digest(path) == digest


def _data_files(folder: Path) -> list[Path]:
    return sorted(f for f in folder.rglob("*") if f.is_file() and f.name != MANIFEST)
