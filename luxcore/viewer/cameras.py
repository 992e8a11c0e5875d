"""Between the browser's camera and ours. Both look along +z with +y down."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from luxcore.cameras import Camera


def camera_of_browser(handle: Any, max_pixels: int) -> Camera:
    """The view of a browser tab (`viser.CameraHandle`), made smaller to at most `max_pixels`."""
    height, width = max(int(handle.image_height), 1), max(int(handle.image_width), 1)
    shrink = min(1.0, math.sqrt(max_pixels / (height * width)))
    height, width = max(1, round(height * shrink)), max(1, round(width * shrink))
    focal = 0.5 * height / math.tan(0.5 * float(handle.fov))
    c2w = np.eye(4)
    c2w[:3, :3] = _rotation(np.asarray(handle.wxyz, float))
    c2w[:3, 3] = handle.position
    return Camera(focal, focal, width / 2, height / 2, width, height, c2w)


def place_browser(handle: Any, camera: Camera, distance: float) -> None:
    """Put a browser's camera where `camera` is, turning about a point `distance` ahead of it.

    `handle` is the camera of a tab or the one that new tabs start with; both have these four.
    """
    up = tuple(-camera.c2w[:3, 1])
    if hasattr(handle, "up_direction"):
        handle.up_direction = up
    else:
        handle.up = up
    handle.position = tuple(camera.centre)
    handle.look_at = tuple(camera.centre + distance * camera.c2w[:3, 2])
    handle.fov = 2 * math.atan(0.5 * camera.height / camera.fy)


def _rotation(wxyz: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(np.roll(wxyz, -1)).as_matrix()
