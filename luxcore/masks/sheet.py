"""A contact sheet: every view with its lamps outlined and numbered."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from luxcore.capture.store import Capture
from luxcore.files.photos import read_photo
from luxcore.masks.store import LampMasks, Mask

COLORS = (
    (1.0, 0.25, 0.2),
    (0.2, 0.75, 1.0),
    (0.35, 0.9, 0.3),
    (1.0, 0.75, 0.1),
    (0.85, 0.4, 1.0),
    (1.0, 0.5, 0.75),
)
"""Display RGB of lamp 0, 1, …; repeated where there are more."""


def overlay(
    photo: Float[np.ndarray, "h w 3"], masks: Sequence[Mask | None]
) -> Float[np.ndarray, "h w 3"]:
    """The photo with each mask outlined in its colour and numbered."""
    import cv2

    picture = np.ascontiguousarray(photo, np.float32).copy()
    scale = max(photo.shape[:2]) / 640
    for index, mask in enumerate(masks):
        if mask is None or not mask.any():
            continue
        color = COLORS[index % len(COLORS)]
        picture[mask] = 0.75 * picture[mask] + 0.25 * np.asarray(color, np.float32)
        outlines, _ = cv2.findContours(
            mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
        )
        cv2.drawContours(picture, outlines, -1, color, max(1, round(scale)))
        rows, columns = np.nonzero(mask)
        place = (int(columns.max()) + 2, int(rows.min()) + 4)
        place = (min(place[0], mask.shape[1] - int(12 * scale)), max(place[1], int(12 * scale)))
        thick = max(1, round(1.5 * scale))
        cv2.putText(picture, str(index), place, cv2.FONT_HERSHEY_SIMPLEX, 0.5 * scale, color, thick)
    return picture


def contact_sheet(
    capture: Capture, masks: LampMasks, columns: int = 5, width: int = 320
) -> np.ndarray:
    """[H, W, 3] display values: all views in rows of `columns`, each `width` pixels wide."""
    import cv2

    tiles = []
    for view, frame in enumerate(capture.frames):
        seen = [masks.mask(view, lamp.index) for lamp in masks.lamps]
        picture = overlay(read_photo(frame.image_path), seen)
        height = max(1, round(picture.shape[0] * width / picture.shape[1]))
        tiles.append(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA))
    columns = min(columns, len(tiles))
    cell = max(tile.shape[0] for tile in tiles)
    sheet = np.zeros((math.ceil(len(tiles) / columns) * cell, columns * width, 3), np.float32)
    for index, tile in enumerate(tiles):
        top, left = (index // columns) * cell, (index % columns) * width
        sheet[top : top + tile.shape[0], left : left + width] = tile
    return sheet
