"""Rotation of vectors by quaternions (w-x-y-z, any non-zero length)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32


def rotate(
    quats: Float32[np.ndarray, "n 4"], vectors: Float32[np.ndarray, "n 3"]
) -> Float32[np.ndarray, "n 3"]:
    """Each vector turned from the axes of its Gaussian into the world's."""
    norm = np.maximum(np.linalg.norm(quats, axis=1, keepdims=True), 1e-12)
    unit = quats / norm
    axis = unit[:, 1:]
    twice = 2 * np.cross(axis, vectors)
    turned = vectors + unit[:, :1] * twice + np.cross(axis, twice)
    return np.asarray(turned, np.float32)
