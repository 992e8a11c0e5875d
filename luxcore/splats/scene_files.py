"""Whether a folder holds a whole scene that this program reads, checked without heavy imports."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from luxcore.errors import FormatError, InputError
from luxcore.files.digests import file_digest
from luxcore.files.json_object import read_object

VERSION = 1
FILES = ("splats.ply", "lights.safetensors", "transforms.json")


def check_scene(folder: Path) -> dict[str, Any]:
    """The description in scene.json, once all files are there and have the sha256 it lists.

    Raises InputError when there is no scene, FormatError naming the file and the fact otherwise.
    """
    folder = Path(folder)
    about = _read_about(folder / "scene.json")
    digests = about.get("digests")
    for name in FILES:
        expected = digests.get(name) if isinstance(digests, dict) else None
        if not (folder / name).is_file():
            raise FormatError(f"{folder / name} does not exist, scene.json lists it.")
        if file_digest(folder / name) != expected:
            raise FormatError(f"{folder / name} is damaged: scene.json lists another sha256.")
    return about


def _read_about(path: Path) -> dict[str, Any]:
    if not path.is_file():
        raise InputError(f"{path} does not exist: {path.parent} is not a scene.")
    about = read_object(path)
    version = about.get("version")
    if version != VERSION:
        raise FormatError(f"{path} is of version {version}, this program reads {VERSION}.")
    return about
