"""What the rasterizer is compiled for, and the constants that every kernel and twin share."""

from __future__ import annotations

import math
from dataclasses import dataclass

TILE = 16
"""Pixels along a tile's side."""
ALPHA_MIN = 1.0 / 255.0
"""A contribution below one 8-bit step is not drawn."""
ALPHA_MAX = 0.99
"""The ceiling of one contribution, the same forward and backward."""
TRANSMITTANCE_MIN = (1.0 - ALPHA_MAX) ** 2
"""A pixel is finished before the Gaussian that would bring its transmittance below this."""
COMPENSATION_MIN = 0.005
"""Floor of the low-pass compensation factor, so that thin Gaussians do not vanish."""
CHORD_SLACK = 0.01
"""px by which the bounds of an ellipse are widened, so that rounding cannot lose a pixel."""
MOMENTS = 6
"""Sums over pixels that carry the gradient of a projected Gaussian, before its colours."""


@dataclass(frozen=True)
class RasterConfig:
    """Compile-time choices of one rasterizer."""

    channels: int = 3
    """Colours per Gaussian; 3 M for M lamps."""
    antialiased: bool = False
    """Mip-style compensation: opacity falls by what the low-pass spread out."""
    near: float = 0.01
    """Gaussians nearer than this along z are not drawn, in the unit of the scene (metres)."""
    eps2d: float = 0.3
    """Variance in px^2 added to every projected Gaussian (the low-pass of 3DGS; 0.1 in Mip)."""
    max_intersections: int = 1 << 28
    """Bound on (Gaussian, tile) pairs of a view; a scene over it is refused, not truncated."""

    def __post_init__(self) -> None:
        if self.channels < 1:
            raise ValueError(f"channels must be at least 1, got {self.channels}.")
        if not self.near > 0 or not self.eps2d > 0:
            raise ValueError(f"near and eps2d must be positive, got {self.near}, {self.eps2d}.")

    def defines(self) -> dict[str, int | float | str]:
        """The -D of every kernel that this configuration is built with."""
        return {
            "TILE": TILE,
            "ALPHA_MIN": ALPHA_MIN,
            "LOG2_ALPHA_MIN": math.log2(ALPHA_MIN),
            "ALPHA_MAX": ALPHA_MAX,
            "TRANSMITTANCE_MIN": TRANSMITTANCE_MIN,
            "COMPENSATION_MIN": COMPENSATION_MIN,
            "CHORD_SLACK": CHORD_SLACK,
            "CHANNELS": self.channels,
            "ANTIALIASED": self.antialiased,
            "NEAR_M": self.near,
            "EPS2D": self.eps2d,
        }

    def partial_size(self, with_depth: bool) -> int:
        """Floats of a row of partial gradients: moments, colours, depth; whole float4s."""
        return -(-(MOMENTS + self.channels + with_depth) // 4) * 4
