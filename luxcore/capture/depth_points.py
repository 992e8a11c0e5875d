"""Coloured points from a distance image."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float

from luxcore.cameras import Camera
from luxcore.capture.points import Points

FAR_M = 500.0
"""What lies farther is sky seen through an opening, not the room."""


def pixel_rays(camera: Camera, u: np.ndarray, v: np.ndarray) -> Float[np.ndarray, "... 3"]:
    """World directions of unit length through pixel positions (u, v), in pixels, float64."""
    local = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy], axis=-1)
    local = np.concatenate([local, np.ones_like(local[..., :1])], axis=-1)
    local /= np.linalg.norm(local, axis=-1, keepdims=True)
    return local @ camera.c2w[:3, :3].T


def points_from_distance(
    ray_distance_m: Float[np.ndarray, "h w"],
    photo: Float[np.ndarray, "h w 3"],
    camera: Camera,
    limit: int,
) -> Points:
    """At most about `limit` points on a regular pixel grid; sky and holes (0) are left out."""
    height, width = ray_distance_m.shape
    stride = max(1, math.ceil(math.sqrt(height * width / max(limit, 1))))
    rows, columns = np.mgrid[stride // 2 : height : stride, stride // 2 : width : stride]
    distance = ray_distance_m[rows, columns]
    seen = np.isfinite(distance) & (distance > 0) & (distance < FAR_M)
    rows, columns, distance = rows[seen], columns[seen], distance[seen]
    rays = pixel_rays(camera, columns + 0.5, rows + 0.5)
    xyz = camera.centre + rays * distance[:, None]
    rgb = np.round(np.clip(photo[rows, columns], 0, 1) * 255).astype(np.uint8)
    return Points(xyz.astype(np.float32), rgb)
