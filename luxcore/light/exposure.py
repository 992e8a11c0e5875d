"""Which exposure a photographer would choose for a linear image, and the brackets around it."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from luxcore.light.blackbody import LUMINANCE_709

BRACKETS_EV = (0.0, -2.0, -4.0)
"""The brightness levels that models are asked for and that a lamp's HDR light is merged from
(paper, 3.2 and 3.3)."""

KEY_LUMINANCE = 0.18
"""Where the middle of the picture is put: middle grey."""
_DARKER_SHARE = 0.95
"""Lamps in sight would darken the room: the brightest pixels do not count."""
_FLOOR = 1e-6


def estimate_exposure(image_linear: Float[np.ndarray, "h w 3"]) -> float:
    """The factor g for which g · image has log-average luminance 0.18 over its darker 95 %.

    A black image gets the exposure of a luminance of 1e-6; values that are not finite are ignored.
    """
    luminance = (np.asarray(image_linear, np.float64) @ LUMINANCE_709).ravel()
    luminance = np.sort(np.maximum(luminance[np.isfinite(luminance)], 0.0))
    kept = luminance[: max(1, int(_DARKER_SHARE * luminance.size))]
    if kept.size == 0:
        return 1.0
    return float(KEY_LUMINANCE / np.exp(np.log(kept + _FLOOR).mean()))
