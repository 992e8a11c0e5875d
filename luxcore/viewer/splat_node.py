"""The Gaussians as the browser draws them."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float, Float32

from luxcore.splats.gaussians import Gaussians


def add_splats(server: Any, gaussians: Gaussians) -> Any:
    """A black `GaussianSplatHandle` of the scene: set its `rgbs` to light it."""
    count = len(gaussians)
    opacities = 1.0 / (1.0 + np.exp(-gaussians.opacity_logits.astype(np.float64)))
    return server.scene.add_gaussian_splats(
        "/room",
        centers=gaussians.means,
        covariances=covariances(gaussians),
        rgbs=np.zeros((count, 3), np.uint8),
        opacities=opacities[:, None].astype(np.float32),
    )


def covariances(gaussians: Gaussians) -> Float32[np.ndarray, "n 3 3"]:
    """Σ = R S Sᵀ Rᵀ of every Gaussian (3DGS, equation 6)."""
    spread = rotations(gaussians.quats.astype(np.float64)) * np.exp(gaussians.log_scales)[:, None]
    return (spread @ spread.transpose(0, 2, 1)).astype(np.float32)


def rotations(quats: Float[np.ndarray, "n 4"]) -> Float[np.ndarray, "n 3 3"]:
    """Rotation matrices of w-x-y-z quaternions, which need not be unit."""
    w, x, y, z = (quats / np.linalg.norm(quats, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)
