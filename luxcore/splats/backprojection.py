"""What the pixels of a view say about each Gaussian: means under its blending weights."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pyopencl.array as cla
from jaxtyping import Float32

from luxcore.cameras import Camera
from luxcore.splats.device import Device
from luxcore.splats.rasterizer import Rasterizer, RasterOutput


@dataclass(frozen=True)
class Backprojection:
    """Per Gaussian: Σ_p w_p I_p over the pixels of a view, and Σ_p w_p."""

    sums: Float32[np.ndarray, "n c"]
    weights: Float32[np.ndarray, " n"]


def backproject(
    device: Device, rasterizer: Rasterizer, out: RasterOutput, image: cla.Array
) -> Backprojection:
    """Gather `image` [h, w, c] with the weights of a forward pass of the same view.

    Colours have no part in it: the image is Σ_i w_ip c_i, so the derivative by c_i of
    Σ_p I_p · image_p is Σ_p w_ip I_p.
    """
    alone = Rasterizer(device, replace(rasterizer.config, channels=1))
    ones = device.zeros((*image.shape[:2], 1)) + np.float32(1)
    sums = rasterizer.color_gradients(out, image).get()
    return Backprojection(sums, alone.color_gradients(out, ones).get()[:, 0])


def view_directions(
    means: Float32[np.ndarray, "n 3"], camera: Camera
) -> Float32[np.ndarray, "n 3"]:
    """Unit vectors from the camera to each mean."""
    offset: np.ndarray = means - camera.centre.astype(np.float32)
    return offset / np.maximum(np.linalg.norm(offset, axis=1, keepdims=True), 1e-12)
