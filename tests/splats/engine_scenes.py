"""Scenes for the engine's tests: random Gaussians before a camera, the same for kernel and twin."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import torch

from luxcore.cameras import Camera
from luxcore.splats.device import Device
from luxcore.splats.rasterizer import RasterConfig, Rasterizer
from luxcore.splats.twin import rasterize

NAMES = ("means", "quats", "log_scales", "opacity_logits", "colors")


@dataclass(frozen=True)
class Scene:
    """float32 numpy inputs of a rasterizer."""

    means: np.ndarray
    quats: np.ndarray
    log_scales: np.ndarray
    opacity_logits: np.ndarray
    colors: np.ndarray

    def replaced(self, **arrays: Any) -> Scene:
        values = {f.name: getattr(self, f.name) for f in fields(self)} | arrays
        return Scene(**{k: np.asarray(v, np.float32) for k, v in values.items()})


def camera_at_origin(width: int = 70, height: int = 50, focal: float = 60.0) -> Camera:
    """Off-centre principal point, sizes that are not multiples of the tile, a tilted pose."""
    angle = 0.2
    c2w = np.eye(4)
    c2w[:3, :3] = [
        [np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)],
    ]  # fmt: skip
    c2w[:3, 3] = (0.1, -0.2, 0.05)
    return Camera(focal, focal * 1.1, width * 0.45, height * 0.55, width, height, c2w)


def random_scene(
    n: int, channels: int = 3, seed: int = 0, camera: Camera | None = None, scale: float = 0.06
) -> Scene:
    """`n` Gaussians in the camera's frustum and a little outside it, z from 1 to 6."""
    camera = camera or camera_at_origin()
    rng = np.random.default_rng(seed)
    z = rng.uniform(1, 6, n)
    u = rng.uniform(-0.1, 1.1, n) * camera.width
    v = rng.uniform(-0.1, 1.1, n) * camera.height
    local = np.stack([(u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z, z], 1)
    means = local @ camera.c2w[:3, :3].T + camera.c2w[:3, 3]
    scene = Scene(
        means,
        rng.normal(size=(n, 4)) * rng.uniform(0.5, 2, (n, 1)),
        np.log(scale) + rng.normal(size=(n, 3)) * 0.5,
        rng.normal(size=n) * 1.5,
        rng.uniform(-0.2, 1.5, (n, channels)),
    )
    return scene.replaced()


def on_device(device: Device, scene: Scene) -> list[Any]:
    return [device.array(getattr(scene, name)) for name in NAMES]


def run_engine(
    device: Device, camera: Camera, config: RasterConfig, scene: Scene, seed: int = 1
) -> tuple[Any, Any, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """(output, gradients, the upstream gradients used)."""
    raster = Rasterizer(device, config)
    out = raster.forward(camera, *on_device(device, scene))
    upstream = upstream_gradients(camera, config.channels, seed)
    return out, raster.backward(out, *(device.array(u) for u in upstream)), upstream


def upstream_gradients(
    camera: Camera, channels: int, seed: int = 1
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    h, w = camera.height, camera.width
    shapes = ((h, w, channels), (h, w), (h, w))
    d_image, d_alpha, d_depth = (rng.normal(size=s).astype(np.float32) for s in shapes)
    return d_image, d_alpha, d_depth * np.float32(0.2)


def run_twin(
    camera: Camera, config: RasterConfig, scene: Scene, upstream: tuple[np.ndarray, ...]
) -> tuple[Any, dict[str, np.ndarray]]:
    """(twin output, gradients by name), all float64."""
    tensors = {n: torch.tensor(getattr(scene, n), dtype=torch.float64) for n in NAMES}
    for tensor in tensors.values():
        tensor.requires_grad_(True)
    out = rasterize(camera, config, *tensors.values())
    parts = (out.image, out.alpha, out.depth)
    losses = [
        (o * torch.tensor(u, dtype=o.dtype)).sum() for o, u in zip(parts, upstream, strict=True)
    ]
    loss = torch.stack(losses).sum()
    gradients = torch.autograd.grad(loss, list(tensors.values()), allow_unused=True)
    return out, {
        n: np.zeros(tensors[n].shape) if g is None else g.numpy()
        for n, g in zip(NAMES, gradients, strict=True)
    }


def relative(actual: Any, expected: Any) -> float:
    """Relative L2 distance."""
    actual, expected = np.asarray(actual, np.float64), np.asarray(expected, np.float64)
    return float(np.linalg.norm(actual - expected) / max(np.linalg.norm(expected), 1e-30))
