"""Which way is up, and how large: a world of unknown axes and scale becomes a room-like one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

MEDIAN_DEPTH = 3.0
"""Units from a camera to the median point: about metres in a living room."""

EYE_HEIGHT = 1.5
"""z of the mean camera, as if a person had held it."""

_MEAN_UP_WEIGHT = 0.02
"""Small: camera x axes decide where the cameras turned, the mean up axis where they did not."""


@dataclass(frozen=True)
class Similarity:
    """x' = scale · rotation · x + translation."""

    scale: float
    rotation: Float[np.ndarray, "3 3"]
    translation: Float[np.ndarray, " 3"]

    def points(self, xyz: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Points in the new world."""
        return self.scale * xyz @ self.rotation.T + self.translation

    def pose(self, c2w: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "4 4"]:
        """A camera-to-world matrix in the new world, still with a rotation in it."""
        moved = np.eye(4)
        moved[:3, :3] = self.rotation @ c2w[:3, :3]
        moved[:3, 3] = self.points(c2w[None, :3, 3])[0]
        return moved


def room_like(c2w: Float[np.ndarray, "n 4 4"], xyz: Float[np.ndarray, "p 3"]) -> Similarity:
    """Turn z up, look along +x on average, put the cameras at eye height and scale to a room.

    `xyz` are points of the scene; without any, the spread of the cameras sets the scale.
    """
    rotation = upright(c2w)
    centres = c2w[:, :3, 3]
    scale = MEDIAN_DEPTH / max(_typical_depth(c2w, xyz), 1e-9)
    translation = -scale * rotation @ centres.mean(axis=0) + [0, 0, EYE_HEIGHT]
    return Similarity(scale, rotation, translation)


def upright(c2w: Float[np.ndarray, "n 4 4"]) -> Float[np.ndarray, "3 3"]:
    """Rotation to a world whose z is up and whose +x is the mean viewing direction.

    Held photos keep their x axis level, so up is the direction most normal to all x axes. Where
    the cameras hardly turned that is ambiguous, and the mean of their up axes breaks the tie.
    """
    x_axes, mean_up = c2w[:, :3, 0], -c2w[:, :3, 1].mean(axis=0)
    spread = x_axes.T @ x_axes / len(c2w) - _MEAN_UP_WEIGHT * np.outer(mean_up, mean_up)
    up = np.linalg.eigh(spread)[1][:, 0]
    up = up if up @ mean_up >= 0 else -up
    forward = c2w[:, :3, 2].mean(axis=0)
    forward -= up * (up @ forward)
    if np.linalg.norm(forward) < 1e-6:
        # Cameras that look all around have no mean direction: any level one will do.
        forward = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    forward /= np.linalg.norm(forward)
    return np.stack([forward, np.cross(up, forward), up])


def _typical_depth(c2w: np.ndarray, xyz: np.ndarray) -> float:
    centres = c2w[:, :3, 3]
    if len(xyz) == 0:
        return float(np.linalg.norm(centres - centres.mean(axis=0), axis=1).max())
    depths = [(xyz - c) @ pose[:3, 2] for c, pose in zip(centres, c2w, strict=True)]
    front = np.concatenate([d[d > 0] for d in depths])
    return float(np.median(front)) if front.size else float(np.linalg.norm(np.ptp(xyz, axis=0)))
