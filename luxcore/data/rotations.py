"""Quaternions, w-x-y-z, and rotation matrices."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float


def matrix_from_quaternion(wxyz: Float[np.ndarray, " 4"]) -> Float[np.ndarray, "3 3"]:
    """The rotation of a quaternion of any length but zero. Raises ValueError for that."""
    length = float(np.linalg.norm(wxyz))
    if not np.isfinite(length) or length < 1e-12:
        raise ValueError("a rotation quaternion is zero or not finite")
    w, x, y, z = wxyz / length
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_from_matrix(rotation: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, " 4"]:
    """The unit quaternion with w ≥ 0, from scipy's x-y-z-w."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(rotation).as_quat()
    wxyz = np.array([w, x, y, z])
    return -wxyz if w < 0 else wxyz
