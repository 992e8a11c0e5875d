"""Depth and normals of a view, from the rendered depth of its Gaussians."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32
from scipy.ndimage import median_filter

from luxcore.cameras import Camera

_MIN_ALPHA = 0.3
"""Below this share of coverage the expected depth says more about holes than about surfaces."""
_MEDIAN = 5


def expected_depth(
    depth: Float32[np.ndarray, "h w"], alpha: Float32[np.ndarray, "h w"]
) -> Float32[np.ndarray, "h w"]:
    """Σ w z / Σ w along the camera's z (metres where the capture is metric); 0 where unknown."""
    known = alpha >= _MIN_ALPHA
    return np.where(known, depth / np.maximum(alpha, _MIN_ALPHA), 0).astype(np.float32)


def normals_from_depth(
    depth_m: Float32[np.ndarray, "h w"], camera: Camera
) -> Float32[np.ndarray, "h w 3"]:
    """Unit normals in world axes, facing the camera; 0 where depth is unknown or too sparse.

    Central differences of the points of a median-filtered depth: the filter keeps edges, the
    differences then see surfaces instead of single Gaussians.
    """
    points = camera_points(median_filter(depth_m, _MEDIAN), camera)
    across, down = _difference(points, 1), _difference(points, 0)
    normal = np.cross(down, across)
    length = np.linalg.norm(normal, axis=2, keepdims=True)
    usable = (length > 1e-20) & (depth_m[..., None] > 0)
    normal = np.where(usable, normal / np.maximum(length, 1e-20), 0)
    facing = np.sign((normal * -points).sum(axis=2, keepdims=True))
    return ((normal * facing) @ camera.c2w[:3, :3].T).astype(np.float32)


def camera_points(
    depth_m: Float32[np.ndarray, "h w"], camera: Camera
) -> Float32[np.ndarray, "h w 3"]:
    """The point seen by each pixel, in camera axes."""
    x = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    y = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
    rays = np.stack([*np.meshgrid(x, y), np.ones(depth_m.shape)], axis=2)
    return (rays * depth_m[..., None]).astype(np.float32)


def _difference(points: Float32[np.ndarray, "h w 3"], axis: int) -> np.ndarray:
    if points.shape[axis] < 2:
        return np.zeros_like(points)
    return np.gradient(points, axis=axis)
