"""A lamp's colour in a photo as level × chromaticity: what a dimmer and a colour wheel act on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from luxcore.light.blackbody import LUMINANCE_709

OFF_BELOW = 1e-4
"""A lamp whose scale is below this share of the brightest counts as off in the photo."""


@dataclass(frozen=True)
class LampLevels:
    """scale = on · level · colour, per lamp."""

    level: Float[np.ndarray, " k"]
    """Luminance of the scale; for a lamp that was off, the median of the others (else 1)."""
    colour: Float[np.ndarray, "k 3"]
    """Linear RGB of luminance 1; white for a lamp that was off. Another colour in its place keeps
    the lamp's luminance when it is white, as in `luxcore.splats.relighting`."""
    on: Bool[np.ndarray, " k"]


def split_scale(scale: Float[np.ndarray, "k 3"]) -> LampLevels:
    """Level, colour and switch of every lamp from its linear RGB in the photo.

    A lamp that was off still gets a level: switching it on must do something to be seen.
    Negative channels, which least squares may leave behind, count as 0.
    """
    scale = np.clip(np.asarray(scale, np.float64).reshape(-1, 3), 0.0, None)
    level = scale @ LUMINANCE_709
    on = level > OFF_BELOW * max(float(level.max(initial=0.0)), OFF_BELOW)
    usual = float(np.median(level[on])) if on.any() else 1.0
    colour = np.ones_like(scale)
    colour[on] = scale[on] / level[on, None]
    return LampLevels(np.where(on, level, usual), colour, on)
