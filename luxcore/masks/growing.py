"""A lamp's mask in a view where it was not noticed, grown from where it must be."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from luxcore.cameras import Camera
from luxcore.masks.grouping import project

AS_BRIGHT = 0.85
"""Pixels count as the lamp from this fraction of its brightness in the views that show it."""

MIN_PIXELS = 12
MIN_CONTRAST = 1.15
"""Grown pixels against the ring around them; below this the place is lit, not a lamp."""


def grow_mask(
    photo: Float[np.ndarray, "h w 3"],
    camera: Camera,
    place: Float[np.ndarray, " 3"],
    extent: float,
    level: float,
) -> Bool[np.ndarray, "h w"] | None:
    """Bright pixels around the lamp's reprojected place that are connected to its middle.

    `extent` is the lamp's radius in world units, `level` its usual display brightness. None where
    the lamp is outside the picture, hidden, or cannot be told from what is around it.
    """
    import cv2

    uv, depth = project(camera, place[None])
    (u, v), z = uv[0], depth[0]
    if z <= 0 or not (0 <= u < camera.width and 0 <= v < camera.height):
        return None
    radius = max(2.0, extent * camera.fx / z)
    rows, columns = np.mgrid[0 : camera.height, 0 : camera.width]
    distance = np.hypot(columns + 0.5 - u, rows + 0.5 - v)
    brightness = photo.mean(axis=2)
    bright = (brightness >= AS_BRIGHT * level) & (distance <= 1.3 * radius)
    _, labels = cv2.connectedComponents(bright.astype(np.uint8), connectivity=8)
    wanted = np.unique(labels[bright & (distance <= 0.5 * radius)])
    mask = np.isin(labels, wanted[wanted > 0])
    ring = (distance <= 2 * radius) & ~mask
    if mask.sum() < MIN_PIXELS or not ring.any():
        return None
    clear = np.median(brightness[mask]) >= MIN_CONTRAST * np.median(brightness[ring])
    return mask if clear else None
