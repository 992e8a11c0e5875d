"""Photos through a real lens to photos of a pinhole camera, by OpenCV."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from luxcore.capture.sparse import Lens
from luxcore.errors import InputError


def undistort(
    name: str, photo: Float[np.ndarray, "h w 3"], lens: Lens
) -> tuple[Float[np.ndarray, "h w 3"], Lens]:
    """The photo without distortion, same size, cropped so that every pixel was seen.

    Raises InputError when the coefficients leave nothing sensible of the picture.
    """
    if not lens.distorted:
        return photo, lens
    import cv2

    size = (lens.width, lens.height)
    # OpenCV puts the centre of the top-left pixel at 0, this project at 0.5.
    k = np.array([[lens.fx, 0, lens.cx - 0.5], [0, lens.fy, lens.cy - 0.5], [0, 0, 1.0]])
    coefficients = np.array(lens.distortion)
    new, _ = cv2.getOptimalNewCameraMatrix(k, coefficients, size, 0)
    zoom = np.array([new[0, 0] / lens.fx, new[1, 1] / lens.fy])
    if not np.isfinite(new).all() or not ((zoom > 0.4) & (zoom < 2.5)).all():
        raise InputError(f"{name} has lens distortion that cannot be removed: {lens.distortion}.")
    x, y = cv2.initUndistortRectifyMap(k, coefficients, np.eye(3), new, size, cv2.CV_32FC1)
    flat = cv2.remap(photo, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    pinhole = Lens(lens.width, lens.height, new[0, 0], new[1, 1], new[0, 2] + 0.5, new[1, 2] + 0.5)
    return flat, pinhole


def scaled(lens: Lens, width: int, height: int) -> Lens:
    """The same lens on another pixel grid; distortion does not depend on the grid."""
    sx, sy = width / lens.width, height / lens.height
    return Lens(
        width, height, lens.fx * sx, lens.fy * sy, lens.cx * sx, lens.cy * sy, lens.distortion
    )
