"""A sparse model as COLMAP describes it: cameras with lens distortion, posed images, points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from luxcore.capture.points import Points
from luxcore.errors import FormatError

MAX_SIDE = 65_536

MODELS: dict[int, tuple[str, int]] = {
    0: ("SIMPLE_PINHOLE", 3),
    1: ("PINHOLE", 4),
    2: ("SIMPLE_RADIAL", 4),
    3: ("RADIAL", 5),
    4: ("OPENCV", 8),
    6: ("FULL_OPENCV", 12),
}
"""COLMAP's id, name and number of parameters of the camera models that can be undistorted."""

PARAMETERS = {name: count for name, count in MODELS.values()}


@dataclass(frozen=True)
class Lens:
    """Intrinsics in pixels (top-left pixel centre at 0.5) and OpenCV's distortion coefficients."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()
    """k1, k2, p1, p2 and optionally k3 (and k4, k5, k6); empty for a pinhole."""

    @property
    def distorted(self) -> bool:
        return any(self.distortion)


@dataclass(frozen=True)
class PosedImage:
    """`w2c` is [4, 4] float64, world to camera, OpenCV axes."""

    name: str
    lens: Lens
    w2c: np.ndarray


@dataclass(frozen=True)
class SparseModel:
    """Images in order of their names; the scale and the axes of the world are arbitrary."""

    images: tuple[PosedImage, ...]
    points: Points


def lens_from_colmap(
    origin: Path, model: str, width: int, height: int, params: tuple[float, ...]
) -> Lens:
    """COLMAP's parameter order to `Lens`. Raises FormatError naming `origin` and the fact."""
    if model not in PARAMETERS:
        known = ", ".join(PARAMETERS)
        raise FormatError(f"{origin} has a camera of model {model!s:.40}; known are {known}.")
    if len(params) != PARAMETERS[model]:
        raise FormatError(
            f"{origin}: a {model} camera has {PARAMETERS[model]} parameters, got {len(params)}."
        )
    if not (0 < width <= MAX_SIDE and 0 < height <= MAX_SIDE):
        raise FormatError(f"{origin} has a camera of {width}x{height} pixels.")
    if model in ("SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL"):
        focal, cx, cy, *radial = params
        lens = Lens(width, height, focal, focal, cx, cy, _padded(radial))
    else:
        fx, fy, cx, cy, *rest = params
        lens = Lens(width, height, fx, fy, cx, cy, tuple(rest))
    if not all(map(math.isfinite, params)) or min(lens.fx, lens.fy) <= 0:
        raise FormatError(f"{origin} has a camera whose focal length or distortion is unusable.")
    return lens


def pose_from_colmap(
    origin: Path, name: str, qvec: tuple[float, ...], tvec: tuple[float, ...]
) -> np.ndarray:
    """[4, 4] world-to-camera of COLMAP's quaternion (w x y z) and translation.

    Raises FormatError naming the image when the quaternion is zero or a number is not finite.
    """
    numbers = np.array([*qvec, *tvec])
    norm = float(np.linalg.norm(numbers[:4]))
    if not np.isfinite(numbers).all() or norm < 1e-6:
        raise FormatError(f"{origin}: the pose of image {name!r:.80} is not a rotation and place.")
    w, x, y, z = numbers[:4] / norm
    w2c = np.eye(4)
    w2c[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    w2c[:3, 3] = numbers[4:]
    return w2c


def check_spread(origin: Path, images: tuple[PosedImage, ...]) -> None:
    """Refuse models that place fewer than two images, one name twice, or all in one spot."""
    names = [image.name for image in images]
    if len(images) < 2:
        raise FormatError(f"{origin} places {len(images)} image; at least two are needed.")
    if len(set(names)) != len(names):
        twice = next(n for n in names if names.count(n) > 1)
        raise FormatError(f"{origin} names the image {twice!r:.80} twice.")
    centres = np.array([-i.w2c[:3, :3].T @ i.w2c[:3, 3] for i in images])
    if np.ptp(centres, axis=0).max() < 1e-9:
        raise FormatError(f"{origin} puts all {len(images)} images in one place.")


def _padded(radial: list[float]) -> tuple[float, ...]:
    return (*radial, *[0.0] * (4 - len(radial))) if radial else ()
