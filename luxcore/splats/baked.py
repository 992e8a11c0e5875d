"""Blending weights of frozen Gaussians, one sparse matrix per view, applied instead of rasterizing.

image [pixels, C] = W · lights [n, C] for any lights, and the gradient by lights is Wᵀ · d_image.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl.array as cla

from luxcore.splats.device import Device, Kernels
from luxcore.splats.rasterizer import RasterConfig, RasterOutput

SPARE_ROWS = 16
"""Rows after the last one that the gathers may read and never use."""


def padded_zeros(device: Device, rows: int, shape: tuple[int, ...]) -> cla.Array:
    """Zeros of `shape`, [rows, C] or an image of `rows` pixels, followed by spare memory."""
    channels = shape[-1]
    flat = device.zeros(((rows + SPARE_ROWS) * channels,))
    return flat[: rows * channels].reshape(shape)


def padded(device: Device, values: np.ndarray) -> cla.Array:
    """A device copy of `values` [rows, C] that `BakedView.render` may gather from."""
    array = padded_zeros(device, len(values), values.shape)
    array.set(np.ascontiguousarray(values, np.float32))
    return array


@dataclass(frozen=True, eq=False)
class _Rows:
    """A sparse matrix by rows: entries of row i are `start[i]` to `start[i + 1]`."""

    start: cla.Array
    others: cla.Array
    weights: cla.Array

    @property
    def count(self) -> int:
        return int(self.start.shape[0]) - 1


@dataclass(frozen=True, eq=False)
class BakedView:
    """W of one view, by pixels and by Gaussians; 16 bytes per non-zero weight."""

    device: Device
    size: tuple[int, int]
    visible: cla.Array
    """[n] uint8, 1 where a Gaussian has any weight."""
    _pixels: _Rows
    _gaussians: _Rows

    @property
    def entries(self) -> int:
        """Non-zero weights."""
        return int(self._pixels.others.shape[0])

    def render(self, lights: cla.Array, image: cla.Array) -> None:
        """`image` [h, w, C] = W · `lights` [n, C], which was made by `padded`."""
        self._gather(self._pixels, lights, image)

    def gather(self, d_image: cla.Array, d_lights: cla.Array) -> None:
        """`d_lights` [n, C] = Wᵀ · `d_image` [h, w, C], which was made by `padded_zeros`."""
        self._gather(self._gaussians, d_image, d_lights)

    def halved(self) -> BakedView:
        """The same with weights of 16 bits: 12 bytes per non-zero weight."""
        rows = (_halved(self.device, part) for part in (self._pixels, self._gaussians))
        return BakedView(self.device, self.size, self.visible, *rows)

    def _gather(self, rows: _Rows, values: cla.Array, out: cla.Array) -> None:
        half = rows.weights.dtype == np.float16
        kernel = _kernels(self.device, int(values.shape[-1]), half=half).apply
        self.device.launch(
            kernel, rows.count, rows.start, rows.others, rows.weights, values, rows.count, out
        )


def bake(device: Device, out: RasterOutput) -> BakedView:
    """The weights with which a forward pass blended its Gaussians."""
    from scipy.sparse import csr_matrix

    camera, saved, n = out.camera, out.saved, out.inputs.count
    height, width = camera.height, camera.width
    kernels = _kernels(device, 1)
    blocks = -(-width // 4) * -(-height // 4)
    size = np.array([width, height], np.int32)
    lists = (size, saved.ranges, saved.sorted_ids, saved.records)
    counts = device.zeros((height * width,), np.int32)
    device.launch(kernels.weights_count, blocks, *lists, counts)
    start = np.concatenate([[0], np.cumsum(counts.get(), dtype=np.int64)])
    total = int(start[-1])
    by_pixel = _Rows(
        device.array(start.astype(np.int32)),
        device.zeros((max(total, 1),), np.int32),
        device.zeros((max(total, 1),)),
    )
    device.launch(
        kernels.weights_fill, blocks, *lists, by_pixel.start, by_pixel.others, by_pixel.weights
    )
    data, ids = by_pixel.weights.get()[:total], by_pixel.others.get()[:total]
    matrix = csr_matrix((data, ids, start), shape=(height * width, n)).tocsc()
    by_gaussian = _Rows(
        device.array(matrix.indptr.astype(np.int32)),
        device.array(_not_empty(matrix.indices.astype(np.int32))),
        device.array(_not_empty(matrix.data)),
    )
    visible = device.array((np.diff(matrix.indptr) > 0).astype(np.uint8))
    return BakedView(device, (height, width), visible, by_pixel, by_gaussian)


def _not_empty(array: np.ndarray) -> np.ndarray:
    return array if len(array) else np.zeros(1, array.dtype)


def _halved(device: Device, rows: _Rows) -> _Rows:
    return _Rows(rows.start, rows.others, device.array(rows.weights.get().astype(np.float16)))


def _kernels(device: Device, channels: int, *, half: bool = False) -> Kernels:
    defines = RasterConfig(channels=channels).defines()
    return device.program("bake", {**defines, "HALF_WEIGHTS": 1} if half else defines)
