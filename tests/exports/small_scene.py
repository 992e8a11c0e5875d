"""A scene of a few Gaussians, two lamps (one of them off) and two cameras."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from luxcore.cameras import Camera, look_at
from luxcore.splats.gaussians import Gaussians, sh_from_color
from luxcore.splats.scene import Scene, SceneLamp, SceneTone, save_scene

CAMERAS = [look_at(np.array([3.0, y, 1.0]), np.zeros(3), 60.0, 40, 30) for y in (-1.0, 1.0)]


def small_scene(n: int = 60) -> Scene:
    draw = np.random.Generator(np.random.PCG64(3))
    gaussians = Gaussians(
        means=draw.normal(scale=0.6, size=(n, 3)).astype(np.float32),
        quats=draw.normal(size=(n, 4)).astype(np.float32),
        log_scales=draw.uniform(-2.5, -1.0, size=(n, 3)).astype(np.float32),
        opacity_logits=draw.uniform(0, 4, size=n).astype(np.float32),
        sh=sh_from_color(draw.uniform(size=(n, 3)).astype(np.float32)),
    )
    lamps = (
        SceneLamp(0, "desk lamp", True, (2.0, 1.0, 0.5)),
        SceneLamp(1, "floor", False, (1.0, 1.0, 1.0)),
    )
    light = draw.uniform(0, 0.5, size=(n, 3, 3)).astype(np.float32)
    return Scene("box", gaussians, light, lamps, (1.0, 0.9, 0.8), SceneTone(1.3, 0.001, 2.2), 2)


def write_small_scene(folder: Path) -> tuple[Scene, list[Camera]]:
    scene = small_scene()
    save_scene(folder, scene, CAMERAS)
    return scene, CAMERAS
