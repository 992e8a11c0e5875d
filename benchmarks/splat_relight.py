"""Relighting a scene of 8 lamps: nothing but the lamps changes, or the camera moves as well."""

from __future__ import annotations

import numpy as np

from benchmarks.splat_measure import measure
from benchmarks.splat_scenes import BenchmarkScene
from luxcore.splats.device import Device
from luxcore.splats.gaussians import SH_C0, Gaussians
from luxcore.splats.relighting import FixedCamera, LampSetting, MovingCamera
from luxcore.splats.scene import Scene, SceneLamp, SceneTone

WHITE = (1.0, 1.0, 1.0)


def relight_row(device: Device, scene: BenchmarkScene, lamps: int = 8) -> dict[str, float]:
    """CPU and wall milliseconds of one picture, on the host, at the scene's camera."""
    lit = _lit_scene(scene, lamps)
    fixed, moving = FixedCamera(lit, scene.camera, device), MovingCamera(lit, device)
    settings = {"lamp_0": LampSetting(0.5, (1.0, 0.6, 0.3))}
    still = measure(lambda: fixed.render(settings))
    walk = measure(lambda: moving.render(scene.camera, settings))
    return {
        "fixed_camera_cpu_ms": still.cpu_ms,
        "fixed_camera_wall_ms": still.wall_ms,
        "moving_camera_cpu_ms": walk.cpu_ms,
        "moving_camera_wall_ms": walk.wall_ms,
        "moving_frames_per_cpu_s": 1e3 / walk.cpu_ms,
    }


def _lit_scene(scene: BenchmarkScene, lamps: int) -> Scene:
    n = len(scene.means)
    means, quats, scales, logits, colors = (
        np.asarray(a, np.float32)
        for a in (scene.means, scene.quats, scene.log_scales, scene.opacity_logits, scene.colors)
    )
    sh = ((colors - 0.5) / SH_C0).astype(np.float32)[:, None, :]
    radiance = np.random.default_rng(0).uniform(size=(n, 1 + lamps, 3)).astype(np.float32)
    return Scene(
        name="benchmark",
        gaussians=Gaussians(means, quats, scales, logits, sh),
        radiance=radiance,
        lamps=tuple(SceneLamp(i, f"lamp_{i}", True, WHITE) for i in range(lamps)),
        ambient_scale=WHITE,
        tone=SceneTone(1.0, 0.01, 2.2),
        views=1,
    )
