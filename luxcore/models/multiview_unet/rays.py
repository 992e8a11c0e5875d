"""Plücker coordinates of the rays of several cameras, finite wherever the cameras stand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from luxcore.cameras import Camera


def plucker_rays(
    cameras: Sequence[Camera], height: int, width: int
) -> Float[Tensor, "v 6 {height} {width}"]:
    """Unit direction and moment (origin × direction) of the ray through each pixel centre.

    Axes and origin are the first camera's; the unit of length is the largest distance of a camera
    from it, so that moments are at most 1 long, whatever the unit of the capture. With all
    cameras in one place, or one camera, moments are 0. Differences of positions are taken in
    float64: cameras a metre apart at 1e6 m keep their metre.
    """
    first = cameras[0]
    rotation = first.c2w[:3, :3]
    offsets = np.stack([camera.centre - first.centre for camera in cameras]) @ rotation  # [v, 3]
    largest = np.linalg.norm(offsets, axis=1).max()
    origins = offsets / (largest if largest > 0 else 1.0)
    rays = [
        _rays(camera, rotation, origin, height, width)
        for camera, origin in zip(cameras, origins, strict=True)
    ]
    return torch.from_numpy(np.stack(rays).astype(np.float32))


def _rays(
    camera: Camera, world_from_first: np.ndarray, origin: np.ndarray, height: int, width: int
) -> np.ndarray:
    small = camera.resized(width, height)
    v, u = np.mgrid[:height, :width] + 0.5
    local = np.stack([(u - small.cx) / small.fx, (v - small.cy) / small.fy, np.ones_like(u)], -1)
    directions = local @ small.c2w[:3, :3].T @ world_from_first  # [h, w, 3] in the first's axes
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    moments = np.cross(np.broadcast_to(origin, directions.shape), directions)
    return np.concatenate([directions, moments], axis=-1).transpose(2, 0, 1)
