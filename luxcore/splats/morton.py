"""An order of points in which neighbours in space are neighbours in memory.

Measured with 100,000 Gaussians in random order: sorted so, the gather by cached weights takes half
the time and the backward pass a quarter less.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32, Int

_BITS = 21


def morton_order(means: Float32[np.ndarray, "n 3"]) -> Int[np.ndarray, " n"]:
    """Positions sorted along the Z-order curve of their bounding cube; ties keep their order."""
    if not len(means):
        return np.arange(0)
    low = means.min(axis=0)
    side = max(float((means.max(axis=0) - low).max()), 1e-30)
    cells = ((means - low).astype(np.float64) / side * (2**_BITS - 1)).astype(np.uint64)
    x, y, z = (_spread(cells[:, axis]) for axis in range(3))
    return np.argsort(x | (y << np.uint64(1)) | (z << np.uint64(2)), kind="stable")


def _spread(value: np.ndarray) -> np.ndarray:
    """Two zero bits after each of the low 21 bits."""
    for shift, mask in (
        (32, 0x1F00000000FFFF),
        (16, 0x1F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        value = (value | (value << np.uint64(shift))) & np.uint64(mask)
    return value
