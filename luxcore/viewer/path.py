"""A camera path through keyframes: smooth in position and in direction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from luxcore.cameras import Camera
from luxcore.errors import InputError


def camera_path(keyframes: Sequence[Camera], frames: int, *, loop: bool = False) -> list[Camera]:
    """`frames` cameras evenly spaced along a curve through `keyframes`, all with the first's size.

    Positions and focal lengths follow a cubic spline, directions the
    corresponding rotation spline. Raises InputError for fewer than two keyframes or frames.
    """
    if len(keyframes) < 2 or frames < 2:
        raise InputError(
            f"a camera path needs two keyframes and two frames, got {len(keyframes)} and {frames}."
        )
    from scipy.interpolate import CubicSpline
    from scipy.spatial.transform import Rotation, RotationSpline

    stops = [*keyframes, keyframes[0]] if loop else list(keyframes)
    knots = np.arange(len(stops), dtype=float)
    times = np.linspace(0, knots[-1], frames, endpoint=not loop)
    first = stops[0]
    placed = np.array([[*camera.centre, camera.fy / camera.height] for camera in stops])
    ends = "periodic" if loop else "natural"
    curve = CubicSpline(knots, placed, bc_type=ends)(times)
    turns = RotationSpline(knots, Rotation.from_matrix([c.c2w[:3, :3] for c in stops]))(times)
    return [
        _camera(first, where[:3], where[3], turn)
        for where, turn in zip(curve, turns.as_matrix(), strict=True)
    ]


def _camera(like: Camera, centre: np.ndarray, focal: float, rotation: np.ndarray) -> Camera:
    c2w = np.eye(4)
    c2w[:3, :3], c2w[:3, 3] = rotation, centre
    pixels = float(focal) * like.height
    return Camera(pixels, pixels, like.width / 2, like.height / 2, like.width, like.height, c2w)
