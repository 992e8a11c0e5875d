"""Which views show a lamp best: large in the picture, whole, central and sharp."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Bool

Mask = Bool[np.ndarray, "h w"]

_CUT = 0.5
"""A lamp cut by the picture's edge counts as half as good."""


def best_views(
    masks: Mapping[int, Mask], sharpness: Mapping[int, float], count: int
) -> tuple[int, ...]:
    """At most `count` views, best first; ties go to the earlier view."""
    if not masks:
        return ()
    largest = max(int(m.sum()) for m in masks.values())
    sharpest = max(sharpness[v] for v in masks) or 1.0

    def score(view: int) -> float:
        size = (masks[view].sum() / largest) ** 0.5
        return size * _placement(masks[view]) * (sharpness[view] / sharpest) ** 0.25

    return tuple(sorted(masks, key=lambda v: (-score(v), v))[:count])


def photo_sharpness(photo: np.ndarray) -> float:
    """Mean square of the Laplacian of the photo's grey values: higher is sharper."""
    grey = photo.mean(axis=2)
    laplacian = (
        grey[:-2, 1:-1] + grey[2:, 1:-1] + grey[1:-1, :-2] + grey[1:-1, 2:] - 4 * grey[1:-1, 1:-1]
    )
    return float((laplacian**2).mean()) if laplacian.size else 0.0


def _placement(mask: Mask) -> float:
    height, width = mask.shape
    rows, columns = np.nonzero(mask)
    off_x = abs(columns.mean() + 0.5 - width / 2) / (width / 2)
    off_y = abs(rows.mean() + 0.5 - height / 2) / (height / 2)
    cut = mask[[0, -1]].any() or mask[:, [0, -1]].any()
    return float((1 - 0.5 * min(1.0, np.hypot(off_x, off_y))) * (_CUT if cut else 1.0))
