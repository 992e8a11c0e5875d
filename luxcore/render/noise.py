"""How noisy each light is, and joining a second render of a light to the first."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

Image = Float[np.ndarray, "h w 3"]


def relative_noise(noisy: Image, denoised: Image, leave_out: Bool[np.ndarray, "h w"]) -> float:
    """Mean absolute residual of the denoiser over the mean radiance; 0 is free of noise.

    `leave_out`: pixels that emit and their rim: bright and clean, they would hide the rest.
    """
    rest = ~leave_out
    level = float(denoised[rest].mean()) if rest.any() else 0.0
    if level <= 0:
        return 0.0
    return float(np.abs(noisy[rest] - denoised[rest]).mean()) / level


def joined(first: Image, first_spp: int, second: Image, second_spp: int) -> Image:
    """The mean of two independent renders, weighted by their samples."""
    total = first_spp + second_spp
    return (first * np.float32(first_spp / total)) + second * np.float32(second_spp / total)
