"""A small room of Gaussians with three lamps, one of them off in the photos."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from luxcore.cameras import look_at
from luxcore.files.photos import write_png
from luxcore.ports import free_port
from luxcore.splats.gaussians import Gaussians, sh_from_color
from luxcore.splats.scene import Scene, SceneLamp, SceneTone, save_scene
from luxcore.viewer.app import Viewer
from luxcore.viewer.open import open_scene

LAMPS = {"desk": (-1.0, 0.0, 1.2), "wall": (0.0, 1.4, 1.6), "floor": (1.2, -0.5, 0.8)}
SCALES = ((2.0, 1.0, 0.5), (0.8, 0.7, 0.5), (0.3, 0.4, 0.4))


def room_scene(count: int = 600) -> Scene:
    """A floor and three walls, lit by inverse squares of the distance to each lamp."""
    random = np.random.Generator(np.random.PCG64(0))
    points = random.uniform([-2, -2, 0], [2, 2, 2.4], (count, 3))
    side = random.integers(0, 4, count)
    for axis, value, wall in ((2, 0.0, 0), (1, 2.0, 1), (0, -2.0, 2), (0, 2.0, 3)):
        points[side == wall, axis] = value
    albedo = np.array([[0.5, 0.4, 0.3], [0.6, 0.6, 0.65], [0.3, 0.45, 0.4], [0.5, 0.3, 0.3]])[side]
    lights = [0.04 * albedo]
    for where in LAMPS.values():
        lights.append(0.5 * albedo / (0.1 + ((points - where) ** 2).sum(1, keepdims=True)))
    size = 3.0 / np.sqrt(count)
    gaussians = Gaussians(
        points.astype(np.float32),
        np.tile(np.float32([1, 0, 0, 0]), (count, 1)),
        np.full((count, 3), np.log(size), np.float32),
        np.full(count, 3.0, np.float32),
        sh_from_color(albedo.astype(np.float32)),
    )
    lamps = tuple(
        SceneLamp(i, name, i != 1, scale)
        for i, (name, scale) in enumerate(zip(LAMPS, SCALES, strict=True))
    )
    radiance = np.stack(lights, axis=1).astype(np.float32)
    return Scene("room", gaussians, radiance, lamps, (1.0, 1.0, 1.0), SceneTone(1.0, 0.0, 2.2), 2)


def save_room(folder: Path, count: int = 600) -> Path:
    """The scene on disk, with two cameras and a thumbnail of the first lamp."""
    cameras = [
        look_at(np.array([x, -3.5, 1.3]), np.array([0.0, 0.5, 0.8]), 60.0, 96, 64)
        for x in (-0.5, 0.5)
    ]
    thumbnail = folder.parent / "thumbnail.png"
    write_png(thumbnail, np.full((32, 32, 3), 0.7, np.float32))
    save_scene(folder, room_scene(count), cameras, {"lamp_0.png": thumbnail})
    return folder


@contextmanager
def serving_room(folder: Path) -> Iterator[Viewer]:
    """A viewer of the room in `folder`/room, writing into `folder`/out; closed at the end."""
    running = Viewer(
        open_scene(save_room(folder / "room")), "127.0.0.1", free_port(), folder / "out"
    )
    yield running
    running.close()
