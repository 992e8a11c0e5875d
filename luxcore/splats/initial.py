"""The Gaussians that a fit starts from: one round blob at each point of the capture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float32, UInt8

from luxcore.cameras import Camera
from luxcore.splats.gaussians import Gaussians, sh_from_color
from luxcore.splats.losses.smoothness import mean_neighbor_distance
from luxcore.splats.morton import morton_order

_NEIGHBORS = 3
_OPACITY = 0.3
"""High enough that a short run needs few steps to close walls, low enough to be seen through."""


def scene_extent(xyz: Float32[np.ndarray, "n 3"], cameras: Sequence[Camera]) -> float:
    """Half the size of the scene in world units: the scale of learning rates and of "large".

    The larger of how far cameras and nine tenths of the points lie from their centres; inside a
    room the cameras alone would say too little, and far outliers among the points too much.
    """
    centres = np.array([camera.centre for camera in cameras])
    reach = np.linalg.norm(centres - centres.mean(axis=0), axis=1).max()
    if len(xyz):
        spread = np.linalg.norm(xyz - np.median(xyz, axis=0), axis=1)
        reach = max(reach, float(np.percentile(spread, 90)))
    return float(reach) if reach > 0 else 1.0


def initial_gaussians(
    xyz: Float32[np.ndarray, "n 3"],
    rgb: UInt8[np.ndarray, "n 3"],
    extent: float,
    limit: int,
    random: np.random.Generator,
) -> Gaussians:
    """At most `limit` Gaussians at points drawn without replacement, in Z-order.

    Each scale is the root mean square distance to the three nearest other points, so duplicates
    and lone points get bounded blobs: between 1e-4 and 0.1 of `extent`.
    """
    if len(xyz) > limit:
        chosen = random.choice(len(xyz), limit, replace=False)
        xyz, rgb = xyz[chosen], rgb[chosen]
    order = morton_order(xyz)
    xyz, rgb = xyz[order], rgb[order]
    distance = mean_neighbor_distance(xyz, _NEIGHBORS, floor=1e-4 * extent)
    scale = np.clip(distance, 1e-4 * extent, 0.1 * extent)
    n = len(xyz)
    return Gaussians(
        means=np.ascontiguousarray(xyz, np.float32),
        quats=np.tile(np.array([1, 0, 0, 0], np.float32), (n, 1)),
        log_scales=np.repeat(np.log(scale)[:, None], 3, axis=1).astype(np.float32),
        opacity_logits=np.full(n, np.log(_OPACITY / (1 - _OPACITY)), np.float32),
        sh=sh_from_color(rgb.astype(np.float32) / 255),
    )


def random_points(
    cameras: Sequence[Camera], count: int, random: np.random.Generator
) -> tuple[Float32[np.ndarray, "n 3"], UInt8[np.ndarray, "n 3"]]:
    """Grey points in front of the cameras, for a capture that came without any.

    Depths are spread in proportion, from a tenth to ten times the cameras' own extent.
    """
    reach = scene_extent(np.empty((0, 3), np.float32), cameras)
    chosen = random.integers(len(cameras), size=count)
    depth = reach * 10 ** random.uniform(-1, 1, count)
    uv = random.random((count, 2))
    points = np.empty((count, 3), np.float32)
    for index, camera in enumerate(cameras):
        mine = chosen == index
        x = (uv[mine, 0] * camera.width - camera.cx) / camera.fx
        y = (uv[mine, 1] * camera.height - camera.cy) / camera.fy
        local = np.stack([x, y, np.ones_like(x)], axis=1) * depth[mine, None]
        points[mine] = local @ camera.c2w[:3, :3].T + camera.centre
    return points, np.full((count, 3), 128, np.uint8)
