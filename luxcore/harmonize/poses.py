"""How far apart two views are, and whether they can see the same things."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from luxcore.cameras import Camera

TURN_WEIGHT = 1.0
"""A turn of 90 degrees counts as much as a step of the capture's own size."""


def pose_distance(cameras: Sequence[Camera]) -> Float[np.ndarray, "n n"]:
    """Camera-pose distance d(i, j): steps in units of the capture's size plus turns of 90 degrees.

    Symmetric, zero on the diagonal; free of the capture's scale (paper, supplement, Inference).
    """
    centres = np.stack([camera.centre for camera in cameras])
    steps = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    size = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    return steps / size + TURN_WEIGHT * _turns_deg(cameras) / 90


def views_linked(cameras: Sequence[Camera]) -> Bool[np.ndarray, "n n"]:
    """Whether two views' fields of view have a direction in common: light can pass between them."""
    fov = np.array([_widest_deg(camera) for camera in cameras])
    return _turns_deg(cameras) < (fov[:, None] + fov[None]) / 2


def _turns_deg(cameras: Sequence[Camera]) -> Float[np.ndarray, "n n"]:
    forward = np.stack([camera.c2w[:3, 2] for camera in cameras])
    forward = forward / np.linalg.norm(forward, axis=1, keepdims=True)
    turns = np.degrees(np.arccos(np.clip(forward @ forward.T, -1, 1)))
    np.fill_diagonal(turns, 0)
    return turns


def _widest_deg(camera: Camera) -> float:
    half = max(camera.width / camera.fx, camera.height / camera.fy) / 2
    return float(2 * np.degrees(np.arctan(half)))
