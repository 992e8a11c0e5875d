"""Which lamps burn in a photo, judged by how their masks shine."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

ABOVE_PHOTO = 3.0
"""A burning lamp's bright part over the photo's median, in linear light."""

ABOVE_RING = 1.6
"""The same over what surrounds the mask: a white shade that is off is hardly brighter."""

RING = 0.03
"""Width of the surroundings, in long sides."""


def burning_lamps(
    image_linear: Float[np.ndarray, "h w 3"], masks: Bool[np.ndarray, "k h w"]
) -> Bool[np.ndarray, " k"]:
    """True for each mask whose brightest tenth outshines both the photo and its surroundings."""
    luminance = image_linear.mean(axis=2)
    middle = float(np.median(luminance))
    return np.array([_burns(luminance, mask, middle) for mask in masks], bool)


def _burns(luminance: np.ndarray, mask: np.ndarray, middle: float) -> bool:
    import cv2

    if not mask.any():
        return False
    width = max(2, round(RING * max(mask.shape)))
    kernel = np.ones((2 * width + 1, 2 * width + 1), np.uint8)
    ring = (cv2.dilate(mask.astype(np.uint8), kernel) > 0) & ~mask
    bright = float(np.quantile(luminance[mask], 0.9))
    around = float(np.median(luminance[ring])) if ring.any() else middle
    return bright > ABOVE_PHOTO * middle and bright > ABOVE_RING * around
