"""Lamps of a single photo."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Bool, Float

from luxcore.errors import LuxError
from luxcore.masks.blobs import Blob, find_blobs, work_size
from luxcore.masks.lampness import lampness, needed
from luxcore.settings.masks import MasksSettings

USUAL_FOCAL = 0.85
"""Focal length over longest side of a usual camera (61° field of view), held level."""

NO_LAMP = (
    "no lamp was found: nothing in the photo glows like one; give masks of the lamps instead, "
    "white on black, as large as the photo."
)


def propose_photo(
    photo: Float[np.ndarray, "h w 3"], settings: MasksSettings | None = None
) -> list[Bool[np.ndarray, "h w"]]:
    """Masks of what looks like lamps in a display-referred photo, most lamp-like first.

    Raises LuxError when nothing does.
    """
    settings = settings or MasksSettings()
    height, width = photo.shape[:2]
    scored = [
        (lampness(blob, _level_elevation_deg(blob, height, width)), blob)
        for blob in find_blobs(photo, settings.min_area, settings.max_area)
    ]
    least = needed(max((score for score, _ in scored), default=-math.inf))
    chosen = sorted((s for s in scored if s[0] >= least), key=lambda s: -s[0])
    if not chosen:
        raise LuxError(NO_LAMP)
    return [full_mask(blob, height, width) for _, blob in chosen[: settings.max_lamps]]


def full_mask(blob: Blob, height: int, width: int) -> Bool[np.ndarray, "h w"]:
    """The region at the size of the photo."""
    import cv2

    mask = blob.on_grid(*work_size(height, width)).astype(np.float32)
    return cv2.resize(mask, (width, height), interpolation=cv2.INTER_LINEAR) > 0.5


def _level_elevation_deg(blob: Blob, height: int, width: int) -> float:
    up = (0.5 - blob.centre[1]) * height
    return math.degrees(math.atan2(up, USUAL_FOCAL * max(height, width)))
