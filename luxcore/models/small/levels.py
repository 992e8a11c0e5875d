"""The range of a photo's values, and the curve by which light is compared."""

from __future__ import annotations

from torch import Tensor

PHOTO_MAX = 16.3
"""Largest linear value that an 8-bit AgX picture at EV0 can carry (docs/models.md)."""

CLIPPED = 0.9 * PHOTO_MAX
"""A pixel whose brightest channel exceeds this is clipped: its true value is unknown."""


def display_curve(linear: Tensor) -> Tensor:
    """Linear light to 0..1 as the eye and AgX see it: x^a/(x^a + m^a), smooth and monotone.

    A stand-in for AgX inside features and losses: mid-grey 0.18 lands at 0.48, 16 at 0.98, and the
    gradient never dies. Reported metrics use AgX itself.
    """
    response = (linear.clamp_min(0) / 0.2 + 1e-6) ** 0.85
    return response / (1 + response)


def linear_of(shown: Tensor) -> Tensor:
    """The inverse of `display_curve`; values from 1 on count as the photo's white."""
    shown = shown.clamp(0, 0.999)
    return 0.2 * (shown / (1 - shown)) ** (1 / 0.85)
