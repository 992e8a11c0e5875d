"""What a rasterizer gives back: images with what the backward pass needs, and gradients."""

from __future__ import annotations

from dataclasses import dataclass

import pyopencl.array as cla

from luxcore.cameras import Camera
from luxcore.splats.rasterizer.binning import TileLists


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
class SavedForBackward:
    """What blending read."""

    records: cla.Array
    """[n, 8] projected Gaussians, laid out as kernels/blending.cl says."""
    lists: TileLists
    used: cla.Array
    """[tiles] Gaussians looked at before a tile's pixels were finished."""

    @property
    def ranges(self) -> cla.Array:
        """[tiles, 2] positions of each tile in `sorted_ids`."""
        return self.lists.ranges

    @property
    def sorted_ids(self) -> cla.Array:
        """[pairs] Gaussians, tile by tile, nearest first."""
        return self.lists.sorted_ids


@dataclass(frozen=True, eq=False)
class RasterOutput:
    """Images of one view; see the package docstring for shapes."""

    image: cla.Array
    alpha: cla.Array
    depth: cla.Array
    radii: cla.Array
    camera: Camera
    inputs: GaussianArrays
    saved: SavedForBackward

    @property
    def intersections(self) -> int:
        """(Gaussian, tile) pairs of the view."""
        return self.saved.lists.pairs


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
