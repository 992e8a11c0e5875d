"""The channel-wise scale that takes the free scale of a light out of a comparison."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float


def channel_scale(
    predicted: Float[np.ndarray, "*shape c"], truth: Float[np.ndarray, "*shape c"]
) -> Float[np.ndarray, " c"]:
    """s_c = Σ truth·predicted / Σ predicted², least squares per channel.

    In linear light that is the natural freedom: a light is known up to its colour and power
    (paper, equation 1). Where the prediction's channel is black any scale serves and 1 is returned;
    a black truth gives 0; never below 0. Pixels that are not finite in either image are left out.
    """
    p = np.asarray(predicted, np.float64).reshape(-1, predicted.shape[-1])
    t = np.asarray(truth, np.float64).reshape(-1, truth.shape[-1])
    known = np.isfinite(p).all(1) & np.isfinite(t).all(1)
    p, t = p[known], t[known]
    energy = (p * p).sum(0)
    fitted = np.maximum((t * p).sum(0), 0.0) / np.where(energy > 0, energy, 1.0)
    return np.where(energy > 0, fitted, 1.0)
