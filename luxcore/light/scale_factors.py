"""The RGB factors c_i with which one-light-at-a-time images add up to the photo (equation 1)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

DARK = 0.02
"""Exposed radiance at which errors stop counting relative to the pixel and count absolutely."""
RIDGE = 1e-6
"""Relative to the lights' energy: decides between collinear lights, moves no others."""
_WHITE = 14.0
_BLACK = 2e-4
"""Exposed radiance outside of these is clipped in the photo (AgX ends at 1.8e-4 and 16.3)."""


def solve(
    photo_linear: Float[np.ndarray, "h w 3"],
    ambient: Float[np.ndarray, "h w 3"],
    olats: Float[np.ndarray, "k h w 3"],
    *,
    usable: Bool[np.ndarray, "h w"] | None = None,
) -> Float[np.ndarray, "k 3"]:
    """c ≥ 0 that minimises Σ ((photo − ambient − Σ c_k · olat_k) / (photo + 0.02))², per channel.

    All images in units where the exposure is 1. Weighing errors relative to the pixel keeps a lamp
    in sight from deciding alone. Pixels that are clipped, black or not finite are dropped, and
    those not in `usable`. Collinear lights share their part (a small ridge); a light that adds
    nothing gets 0.
    """
    count = len(olats)
    finite = np.isfinite(photo_linear) & np.isfinite(ambient) & np.isfinite(olats).all(0)
    kept = finite & (photo_linear > _BLACK) & (photo_linear < _WHITE)
    if usable is not None:
        kept &= usable[..., None]
    result = np.zeros((count, 3))
    for channel in range(3):
        pixels = kept[..., channel]
        y = photo_linear[pixels, channel].astype(np.float64)
        weight = 1.0 / (y + DARK)
        rest = (y - ambient[pixels, channel]) * weight
        lights = olats[:, pixels, channel].T.astype(np.float64) * weight[:, None]
        result[:, channel] = _nonnegative(lights, rest)
    return result.astype(np.float32)


def _nonnegative(
    lights: Float[np.ndarray, "n k"], rest: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " k"]:
    """Ridged non-negative least squares through the k x k normal equations."""
    from scipy.optimize import nnls

    size = np.sqrt((lights**2).sum(0))
    lit = size > 0
    result = np.zeros(lights.shape[1])
    if not lit.any() or not rest.any():
        return result
    # Unit columns: the ridge then weighs a dim lamp like a bright one.
    unit = lights[:, lit] / size[lit]
    normal = unit.T @ unit + RIDGE * np.eye(int(lit.sum()))
    factor = np.linalg.cholesky(normal)
    found, _ = nnls(factor.T, np.linalg.solve(factor, unit.T @ rest))
    result[lit] = found / size[lit]
    return result
