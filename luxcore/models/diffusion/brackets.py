"""A lamp's light as the three display pictures that the paper's models are trained to make."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from luxcore.light.agx import agx
from luxcore.light.exposure import BRACKETS_EV
from luxcore.light.hdr import merge_brackets

LIT_PERCENTILE = 90.0
LIT_RADIANCE = 0.7
"""At EV 0 nine tenths of an OLAT lie below this radiance: the lit part of the room is well
exposed, and four stops below it the lamp itself is, up to about 180 (AgX is white above 16.3)."""


def olat_exposure(lights: Sequence[Float[np.ndarray, "h w 3"]]) -> float:
    """The factor g that exposes a lamp's light for EV 0, one for all views of a scene.

    `lights` are the lamp's linear OLATs. The unit of an OLAT is free, so g puts every lamp, weak
    or strong, into the range that the models have seen. 1 where there is no light at all.
    """
    strongest = np.concatenate([light.max(axis=-1).ravel() for light in lights])
    level = float(np.percentile(strongest, LIT_PERCENTILE))
    if level <= 0:
        # The lamp lights less than a tenth of what is seen.
        level = float(strongest.max())
    return LIT_RADIANCE / level if level > 0 else 1.0


def olat_picture(
    light: Float[np.ndarray, "h w 3"], exposure: float, exposure_ev: float
) -> Float[np.ndarray, "h w 3"]:
    """The bracket AgX(2^ev · g · I), display-referred in 0..1."""
    return agx((light * (exposure * 2.0**exposure_ev)).astype(np.float32))


def merged_light(
    pictures: Sequence[Float[np.ndarray, "h w 3"]], exposure: float = 1.0
) -> Float[np.ndarray, "h w 3"]:
    """Linear light of a model's pictures at BRACKETS_EV (Debevec's merge), the inverse of
    `olat_picture`.

    What a model paints may lie outside of Rec.709, where one channel is negative: it becomes 0.
    """
    return np.maximum(merge_brackets(pictures, BRACKETS_EV, exposure=exposure).radiance, 0)
