"""Constants of the losses, in one place for the kernels (as -D), the twins and the tests."""

from __future__ import annotations

import math

SSIM_C1 = 0.01**2
"""Stabilises the luminance term of SSIM for images in 0..1."""
SSIM_C2 = 0.03**2
"""Stabilises the contrast and structure term."""
SSIM_RADIUS = 5
_SIGMA = 1.5


def _gaussian_window() -> tuple[float, ...]:
    taps = [math.exp(-(k**2) / (2 * _SIGMA**2)) for k in range(-SSIM_RADIUS, SSIM_RADIUS + 1)]
    return tuple(t / sum(taps) for t in taps)


SSIM_WINDOW = _gaussian_window()

BETA_MIN = 1e-4
"""Floor of the tone curve's offset β, relative to a scene exposed around one."""
GAMMA_MIN, GAMMA_MAX = 1.0, 4.0
"""Bounds of the tone curve's γ: a display curve is never steeper than linear nor beyond these."""
PHOTO_CLIPPED = 0.98
"""A photo at or above this display value is clipped: the light may be any amount brighter."""
CLIPPED = 2.97
"""Where the toned photo counts as clipped: T of a radiance of 11, which AgX shows as 0.98."""
