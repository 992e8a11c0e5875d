"""A small photo with an ambient layer and lamps whose recomposition is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from luxcore.light.agx import agx


@dataclass(frozen=True)
class Photo:
    """What `write_explorer` takes."""

    photo_display: np.ndarray
    ambient_linear: np.ndarray
    olats_linear: np.ndarray
    scale: np.ndarray
    names: list[str]
    exposure: float

    def arguments(self) -> tuple:
        return (
            self.photo_display,
            self.ambient_linear,
            self.olats_linear,
            self.scale,
            self.names,
            self.exposure,
        )


def make_photo(height: int, width: int, lamps: int, noise: float = 0.0) -> Photo:
    """Pools of light over soft texture; lamp values from 1e-4 to 60, as emitters in a photo."""
    random = np.random.Generator(np.random.PCG64(0))
    y, x = np.mgrid[0:height, 0:width] / max(height, width)
    albedo = 0.4 + 0.3 * np.sin(9 * x + 4 * y)[..., None] * np.array([1.0, 0.8, 0.5])
    albedo = albedo * (1 + noise * random.standard_normal((height, width, 3)))
    olats = []
    for i in range(lamps):
        cx, cy = (i + 0.5) / lamps, 0.3 + 0.1 * (i % 2)
        distance = (x - cx) ** 2 + (y - cy * height / width) ** 2
        olats.append(
            albedo * (0.03 / (distance + 0.02))[..., None] + 60 * (distance < 4e-4)[..., None]
        )
    olats_linear = np.stack(olats).astype(np.float32)
    ambient = (0.05 * albedo * (1.2 - y)[..., None]).astype(np.float32)
    scale = np.array([[1.0, 0.75, 0.5], [0.4, 0.45, 0.5], [0.8, 0.8, 0.8], [1.5, 1.0, 0.6]])[:lamps]
    mixed = ambient + np.einsum("khwc,kc->hwc", olats_linear, scale)
    display = agx((2.0 * mixed).astype(np.float32))
    names = [f"lamp {i}" for i in range(lamps)]
    return Photo(display, ambient, olats_linear, scale, names, 2.0)
