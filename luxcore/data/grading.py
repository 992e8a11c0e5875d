"""A photo as other cameras and their owners finish it: more or less contrast, another white.

Real photos are not AgX pictures of linear light. A tone curve changes what all light of a pixel
adds up to, and leaves each lamp's share of it as it was: so shares are still the truth to learn.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy.random import Generator

from luxcore.data.crops import LitCrop

CONTRAST = 0.2
"""Standard deviation of the logarithm of the curve's exponent."""

BALANCE = 0.1
"""The same of the factor on each channel."""

MID_GREY = 0.18
FLOOR = 1e-3
"""Light below this, after exposure, is changed as this is: no power of zero."""


def graded(crop: LitCrop, rng: Generator) -> LitCrop:
    """The photo under balance · x^contrast about mid-grey. Light of lamps that are off, which is
    not in the photo, gets the same curve by itself."""
    contrast = np.exp(rng.normal(0, CONTRAST))
    balance = np.exp(rng.normal(0, BALANCE, 3))

    def gain(linear: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        exposed = np.maximum(crop.exposure * linear, FLOOR) / MID_GREY
        return (balance * exposed ** (contrast - 1)).astype(np.float32)

    together = gain(crop.image_linear)
    on = crop.on[:, None, None, None]
    return replace(
        crop,
        ambient=crop.ambient * together,
        lights=crop.lights * np.where(on, together, gain(crop.lights)),
    )
