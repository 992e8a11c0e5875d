"""What a rasterizer gives back: images with what the backward pass needs, and gradients."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pyopencl.array as cla

from luxcore.cameras import Camera


@dataclass(frozen=True, eq=False)
class GaussianArrays:
    """The five input arrays of one forward pass, on the device."""

    means: cla.Array
    quats: cla.Array
    log_scales: cla.Array
    opacity_logits: cla.Array
    colors: cla.Array

    @property
    def count(self) -> int:
        """Number of Gaussians."""
        return int(self.means.shape[0])


@dataclass(frozen=True, eq=False)
class RasterOutput:
    """Images of one view; see the package docstring for shapes."""

    image: cla.Array
    alpha: cla.Array
    depth: cla.Array
    radii: cla.Array
    intersections: int
    """(Gaussian, tile) pairs that were drawn."""
    camera: Camera
    inputs: GaussianArrays
    saved: Any
    """Projected records and the sorted lists, for `Rasterizer.backward` alone."""


@dataclass(frozen=True, eq=False)
class RasterGradients:
    """Gradients of a scalar loss; see the package docstring for shapes."""

    means: cla.Array
    quats: cla.Array
    log_scales: cla.Array
    opacity_logits: cla.Array
    colors: cla.Array
    mean2d_norm: cla.Array
    visible: cla.Array
