"""Other paint on a known room: the same light on surfaces of other colours.

Reflected light is proportional to a surface's colour. So a pattern multiplied into every light of a
photo leaves each lamp's share of a pixel as it was, and gives the network a photo that it has not
learnt by heart. Colour that light picks up between two surfaces is left as it was.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy.random import Generator

from luxcore.data.crops import LitCrop

MOST_PATCHES = 6
TINT = 0.2
"""Standard deviation of the logarithm of the factor on each channel of the whole photo."""
PATCH_VALUE, PATCH_TINT = 0.45, 0.15
"""The same for a patch: for all channels together, and for each."""


def repainted(crop: LitCrop, rng: Generator) -> LitCrop:
    """The photo with a tint and up to MOST_PATCHES patches of other paint; lamps keep theirs."""
    gain = _paint(rng, *crop.depth_m.shape)
    gain[crop.masks.any(0)] = 1.0
    return replace(crop, ambient=crop.ambient * gain, lights=crop.lights * gain)


def _paint(rng: Generator, height: int, width: int) -> Float[np.ndarray, "h w 3"]:
    """Factors about 1: a tint, and half planes and ellipses of their own colour."""
    y, x = np.mgrid[0:height, 0:width]
    x, y = x / width - 0.5, y / height - 0.5
    log_gain = np.zeros((height, width, 3)) + rng.normal(0, TINT, 3)
    for _ in range(int(rng.integers(0, MOST_PATCHES + 1))):
        colour = rng.normal(0, PATCH_VALUE) + rng.normal(0, PATCH_TINT, 3)
        log_gain[_patch(rng, x, y)] += colour
    return np.exp(log_gain).astype(np.float32)


def _patch(rng: Generator, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Where one patch lies: an ellipse, or a half plane as of another wall."""
    angle = rng.uniform(0, 2 * np.pi)
    along, across = (
        x * np.cos(angle) + y * np.sin(angle),
        y * np.cos(angle) - x * np.sin(angle),
    )
    if rng.random() < 0.3:
        return along > rng.uniform(-0.3, 0.5)
    middle, size = rng.uniform(-0.5, 0.5, 2), rng.uniform(0.05, 0.4, 2)
    return ((along - middle[0]) / size[0]) ** 2 + ((across - middle[1]) / size[1]) ** 2 < 1
