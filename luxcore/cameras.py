"""Pinhole cameras. Inside the project axes are OpenCV's: x right, y down, z forward, metres.

nerfstudio's `transforms.json` uses OpenGL's axes (y up, z backward); the conversion is here only.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from luxcore.errors import InputError
from luxcore.files.json_numbers import LARGEST

OPENGL_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Camera:
    """A pinhole camera without distortion.

    `fx fy cx cy` are in pixels; the centre of the top-left pixel is (0.5, 0.5).
    `c2w` is [4, 4] float64, camera to world, OpenCV axes.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int
    c2w: np.ndarray

    def __post_init__(self) -> None:
        problem = _camera_problem(self)
        if problem:
            raise InputError(f"camera {problem}.")

    @property
    def viewmat(self) -> np.ndarray:
        """[4, 4] float64, world to camera."""
        rotation, centre = self.c2w[:3, :3], self.c2w[:3, 3]
        viewmat = np.eye(4)
        viewmat[:3, :3] = rotation.T
        viewmat[:3, 3] = -rotation.T @ centre
        return viewmat

    @property
    def intrinsics(self) -> np.ndarray:
        """[3, 3] float64 matrix K."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1.0]])

    @property
    def centre(self) -> np.ndarray:
        """[3] position in the world, metres where the capture is metric."""
        return self.c2w[:3, 3]

    def resized(self, width: int, height: int) -> Camera:
        """The same view sampled on another pixel grid."""
        sx, sy = width / self.width, height / self.height
        return Camera(
            self.fx * sx, self.fy * sy, self.cx * sx, self.cy * sy, width, height, self.c2w
        )


def look_at(
    eye: np.ndarray, target: np.ndarray, fov_x_deg: float, width: int, height: int
) -> Camera:
    """A camera at `eye` looking at `target`, world z up, horizontal field of view in degrees."""
    forward = np.asarray(target, float) - np.asarray(eye, float)
    forward /= np.linalg.norm(forward)
    up = np.array([0.0, 0, 1]) if abs(forward[2]) < 0.999 else np.array([0.0, 1, 0])
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    c2w = np.eye(4)
    c2w[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    c2w[:3, 3] = eye
    focal = 0.5 * width / math.tan(math.radians(fov_x_deg) / 2)
    return Camera(focal, focal, width / 2, height / 2, width, height, c2w)


def camera_from_nerfstudio(
    frame: Mapping[str, Any], shared: Mapping[str, Any] | None = None
) -> Camera:
    """A nerfstudio frame (`transform_matrix`, and `fl_x fl_y cx cy w h` in it or in `shared`)."""
    merged = {**(shared or {}), **frame}
    missing = [k for k in ("fl_x", "w", "h", "transform_matrix") if k not in merged]
    if missing:
        raise InputError(f"camera lacks {', '.join(missing)}.")
    try:
        c2w = np.array(merged["transform_matrix"], float)
        fx, width, height = float(merged["fl_x"]), int(merged["w"]), int(merged["h"])
        fy = float(merged.get("fl_y", fx))
        cx, cy = float(merged.get("cx", width / 2)), float(merged.get("cy", height / 2))
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"camera has a value that is not a number: {error}.") from error
    if c2w.shape == (3, 4):
        c2w = np.vstack([c2w, [0, 0, 0, 1]])
    if c2w.shape != (4, 4):
        raise InputError(f"camera transform_matrix must be 4x4, got shape {c2w.shape}.")
    # Not as a product of matrices, which would make NaN of the infinities that are reported.
    return Camera(fx, fy, cx, cy, width, height, c2w * OPENGL_FROM_OPENCV.diagonal())


def camera_to_nerfstudio(camera: Camera) -> dict[str, Any]:
    """The inverse of `camera_from_nerfstudio`: one self-contained frame."""
    return {
        "fl_x": camera.fx,
        "fl_y": camera.fy,
        "cx": camera.cx,
        "cy": camera.cy,
        "w": camera.width,
        "h": camera.height,
        "transform_matrix": (camera.c2w @ OPENGL_FROM_OPENCV).tolist(),
    }


def _camera_problem(camera: Camera) -> str | None:
    if camera.width < 1 or camera.height < 1:
        return f"size must be at least 1x1, got {camera.width}x{camera.height}"
    numbers = (camera.fx, camera.fy, camera.cx, camera.cy)
    if not all(abs(v) < LARGEST for v in numbers) or min(camera.fx, camera.fy) <= 0:
        return f"intrinsics must be finite with a positive focal length, got {numbers}"
    return pose_problem(camera.c2w)


def pose_problem(c2w: np.ndarray) -> str | None:
    """What makes a matrix no camera-to-world pose, to follow the word "camera"; None: it is one."""
    if c2w.shape != (4, 4) or not (np.abs(c2w) < LARGEST).all():
        return "c2w must be a finite 4x4 matrix"
    if not np.allclose(c2w[3], (0, 0, 0, 1), atol=1e-6):
        return f"c2w must end in the row 0 0 0 1, got {c2w[3].tolist()}"
    rotation = c2w[:3, :3]
    # Loose, since some files round to four digits.
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3):
        return "c2w must hold a rotation, its first three columns are not orthonormal"
    if np.linalg.det(rotation) < 0:
        return "c2w must hold a rotation, it mirrors the world instead"
    return None
