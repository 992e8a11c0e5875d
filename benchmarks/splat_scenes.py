"""Scenes that the rasterizer is timed on: a random one of any size, and a real captured one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from luxcore.cameras import Camera
from luxcore.splats.device import Device

FOCAL = 0.87
"""Focal length over image width: 60 degrees."""
SIGMA_PX = 4.0
OPACITY_LOGIT = (1.25, 1.5)
"""Mean and spread. With SIGMA_PX, 100,000 Gaussians draw 49 contributions on a pixel of 512x512,
as many as in the published trial (a 51 MB cache of float32 weights for such a view)."""
GARDEN = Path("gsplat-garden/assets/test_garden.npz")


@dataclass(frozen=True)
class BenchmarkScene:
    """float32 inputs of a rasterizer and the view to draw."""

    name: str
    camera: Camera
    means: np.ndarray
    quats: np.ndarray
    log_scales: np.ndarray
    opacity_logits: np.ndarray
    colors: np.ndarray

    def on_device(self, device: Device, channels: int | None = None) -> list[Any]:
        """The five arrays; `channels` repeats the colours to that many."""
        colors = self.colors
        if channels is not None:
            colors = np.resize(colors.T, (channels, len(colors))).T
        arrays = (self.means, self.quats, self.log_scales, self.opacity_logits, colors)
        return [device.array(np.asarray(a, np.float32)) for a in arrays]


def random_view(count: int, width: int = 512, height: int = 512, seed: int = 0) -> BenchmarkScene:
    """`count` Gaussians, uniform over the image and from 2 to 10 m, of SIGMA_PX on a 512-px image.

    Their size in pixels grows with the image's width.
    """
    rng = np.random.default_rng(seed)
    focal = FOCAL * width
    camera = Camera(focal, focal, width / 2, height / 2, width, height, np.eye(4))
    z = rng.uniform(2, 10, count)
    u, v = rng.uniform(0, 1, count) * width, rng.uniform(0, 1, count) * height
    means = np.stack([(u - camera.cx) / focal * z, (v - camera.cy) / focal * z, z], 1)
    size = SIGMA_PX * width / 512 * z[:, None] / focal * np.exp(0.5 * rng.normal(size=(count, 3)))
    mean, spread = OPACITY_LOGIT
    logits = mean + spread * rng.normal(size=count)
    return BenchmarkScene(
        f"random {count:,}", camera, means, rng.normal(size=(count, 4)), np.log(size), logits,
        rng.uniform(size=(count, 3)),
    )  # fmt: skip


def captured_view(shared_data: Path) -> BenchmarkScene | None:
    """A view of the captured garden, its points as Gaussians as large as their spacing.

    None where the third-party data are absent.
    """
    path = shared_data / GARDEN
    if not path.is_file():
        return None
    from scipy.spatial import cKDTree

    stored = np.load(path)
    means = stored["means3d"].astype(np.float64)
    fx, fy, cx, cy = stored["Ks"][0].astype(float)[[0, 1, 0, 1], [0, 1, 2, 2]]
    camera = Camera(
        float(fx), float(fy), float(cx), float(cy), int(stored["width"]), int(stored["height"]),
        np.linalg.inv(stored["viewmats"][0].astype(float)),
    ).resized(512, 512)  # fmt: skip
    spacing = cKDTree(means).query(means, k=4)[0][:, 1:].mean(1).clip(1e-5)
    count = len(means)
    return BenchmarkScene(
        f"captured garden {count:,}", camera, means, np.tile([1.0, 0, 0, 0], (count, 1)),
        np.log(np.tile(spacing[:, None], (1, 3))), np.full(count, 1.0), stored["colors"] / 255.0,
    )  # fmt: skip
