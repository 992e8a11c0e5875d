"""Read a scene folder for the viewer."""

from __future__ import annotations

import json
from pathlib import Path

from luxcore.cameras import camera_from_nerfstudio
from luxcore.errors import FormatError, InputError
from luxcore.splats.scene import load_scene
from luxcore.viewer.app import ViewedScene


def open_scene(folder: Path) -> ViewedScene:
    """Scene, cameras and thumbnails. Raises InputError or FormatError naming the file."""
    folder = Path(folder)
    scene = load_scene(folder)
    path = folder / "transforms.json"
    try:
        transforms = json.loads(path.read_text(encoding="utf-8"))
        cameras = tuple(camera_from_nerfstudio(f, transforms) for f in transforms["frames"])
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, InputError) as error:
        fact = str(error).rstrip(".")
        raise FormatError(f"{path} holds no usable cameras: {fact}.") from error
    thumbnails = {lamp.index: folder / f"thumbnails/lamp_{lamp.index}.png" for lamp in scene.lamps}
    return ViewedScene(scene, cameras, {i: p for i, p in thumbnails.items() if p.is_file()})
