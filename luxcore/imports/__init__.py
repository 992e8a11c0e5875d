"""Rooms from elsewhere: Aria's scene language, and glTF, USD, OBJ and .blend files."""

from __future__ import annotations

from pathlib import Path

from luxcore.errors import InputError
from luxcore.imports.language_room import language_to_room
from luxcore.imports.scene_file import SUFFIXES, read_scene_file
from luxcore.imports.scene_language import read_scene_language
from luxcore.imports.scene_room import ImportedRoom, scene_to_room

__all__ = ["ImportedRoom", "import_room"]

LANGUAGE_SUFFIXES = frozenset({".txt", ".ase"})


def import_room(path: Path, *, seed: int = 0, unit_m: float | None = None) -> ImportedRoom:
    """A room from any file that can be read, by its suffix.

    `seed` draws what the scene language leaves open; `unit_m` overrules a file's unit.
    Raises InputError or FormatError naming the file (and the line) and the fact.
    """
    path = Path(path)
    if path.suffix.lower() in LANGUAGE_SUFFIXES:
        return ImportedRoom(language_to_room(read_scene_language(path), seed), (), ())
    if path.is_file() and path.suffix.lower() not in SUFFIXES:
        kinds = ", ".join(sorted(SUFFIXES | LANGUAGE_SUFFIXES))
        raise InputError(f"{path} is none of {kinds}.")
    return scene_to_room(read_scene_file(path), unit_m)
