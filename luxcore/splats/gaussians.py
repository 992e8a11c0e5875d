"""The Gaussians of a scene as they are stored: the parameters before their activations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

SH_C0 = 0.28209479177387814
"""Value of the constant spherical harmonic: colour = 0.5 + SH_C0 · sh[:, 0]."""


@dataclass(frozen=True)
class Gaussians:
    """N Gaussians. World units are metres where the capture is metric.

    `quats` are w-x-y-z and need not be unit; scale = exp(log_scales); opacity =
    sigmoid(opacity_logits); `sh` holds K = (degree + 1)² coefficients of display-referred colour.
    """

    means: Float32[np.ndarray, "n 3"]
    quats: Float32[np.ndarray, "n 4"]
    log_scales: Float32[np.ndarray, "n 3"]
    opacity_logits: Float32[np.ndarray, " n"]
    sh: Float32[np.ndarray, "n k 3"]
    antialiased: bool = False
    """Whether the opacities were fitted with the low-pass compensation of Mip-Splatting."""

    def __len__(self) -> int:
        return len(self.means)

    @property
    def sh_degree(self) -> int:
        """0 to 3."""
        return round(self.sh.shape[1] ** 0.5) - 1

    def take(self, index: np.ndarray) -> Gaussians:
        """The Gaussians at `index` (positions or a boolean mask), in that order."""
        return Gaussians(
            self.means[index],
            self.quats[index],
            self.log_scales[index],
            self.opacity_logits[index],
            self.sh[index],
            self.antialiased,
        )


def sh_from_color(color: Float32[np.ndarray, "n 3"]) -> Float32[np.ndarray, "n 1 3"]:
    """Degree-0 coefficients whose colour (display-referred, 0..1) is `color`."""
    return ((color - 0.5) / SH_C0).astype(np.float32)[:, None, :]


def color_from_sh(sh: Float32[np.ndarray, "n k 3"]) -> Float32[np.ndarray, "n 3"]:
    """The view-independent part of the colour, clamped at zero as 3DGS viewers do."""
    return np.maximum(0.5 + SH_C0 * sh[:, 0], 0).astype(np.float32)
