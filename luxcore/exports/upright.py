"""Our world is z up; formats of the glTF family are y up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from luxcore.splats.gaussians import Gaussians

# A quarter turn about x that takes z to y, w-x-y-z.
_HALF = 0.5**0.5
_TURN = (_HALF, -_HALF, 0.0, 0.0)


def y_up(gaussians: Gaussians) -> Gaussians:
    """The same Gaussians with (x, y, z) turned to (x, z, -y).

    Colours that depend on the view would have to be turned as well, so only degree 0 is taken.
    """
    if gaussians.sh_degree != 0:
        raise ValueError(f"spherical harmonics must be of degree 0, got {gaussians.sh_degree}.")
    x, y, z = gaussians.means.T
    w1, x1, *_ = _TURN
    w2, x2, y2, z2 = gaussians.quats.T
    quats = [w1 * w2 - x1 * x2, w1 * x2 + x1 * w2, w1 * y2 - x1 * z2, w1 * z2 + x1 * y2]
    return replace(
        gaussians,
        means=np.stack([x, z, -y], axis=1).astype(np.float32),
        quats=np.stack(quats, axis=1).astype(np.float32),
    )
