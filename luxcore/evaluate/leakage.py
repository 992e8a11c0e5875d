"""The mask decides: how much of a lamp's light lands on other lamps' emitters."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float


def foreign_energy(
    light: Float[np.ndarray, "h w 3"],
    masks: Bool[np.ndarray, "k h w"],
    on: Bool[np.ndarray, " k"],
    lamp: int,
) -> float | None:
    """Share (0..1) of a lamp's energy inside other burning lamps' masks; None without any."""
    others = [k for k in range(len(masks)) if k != lamp and on[k]]
    foreign = (
        masks[others].any(axis=0) & ~masks[lamp] if others else np.zeros(light.shape[:2], bool)
    )
    total = float(light.sum(dtype=np.float64))
    if not foreign.any() or total <= 0:
        return None
    return float(light[foreign].sum(dtype=np.float64)) / total
