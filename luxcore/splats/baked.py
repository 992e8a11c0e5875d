"""Blending weights of frozen Gaussians, one sparse matrix per view, applied instead of rasterizing.

image [pixels, C] = W · lights [n, C] for any lights, and the gradient by lights is Wᵀ · d_image.
W is held by quads of 2x2 pixels: kernels/weights_bake.cl. Images are equal to the rasterizer's to
the bit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pyopencl.array as cla
from jaxtyping import Bool, Int

from luxcore.splats.device import Device, Kernels
from luxcore.splats.rasterizer import RasterConfig, RasterOutput
from luxcore.splats.rasterizer.binning import tile_grid
from luxcore.splats.rasterizer.config import TILE

SPARE_ROWS = 16
"""Rows after the last one that the kernels may read and never use."""
CHUNK = 64
"""Gaussians of a tile that are held at once while baking."""
QUADS = TILE * TILE // 4
"""Quads of 2x2 pixels in a tile."""
GROUP_VECTORS = 6
"""float8s of channels that stay in registers at once."""


def padded_zeros(device: Device, rows: int, shape: tuple[int, ...]) -> cla.Array:
    """Zeros of `shape`, [rows, C] or an image of `rows` pixels, followed by spare memory."""
    channels = shape[-1]
    flat = device.zeros(((rows + SPARE_ROWS) * channels,))
    return flat[: rows * channels].reshape(shape)


def padded(device: Device, values: np.ndarray) -> cla.Array:
    """A device copy of `values` [rows, C] that `BakedView.render` may read beyond its end."""
    array = padded_zeros(device, len(values), values.shape)
    array.set(np.ascontiguousarray(values, np.float32))
    return array


@dataclass(frozen=True, eq=False)
class _Entries:
    """Non-zero weights by quads, nearest Gaussian first: entries of quad i are `start[i]` to
    `start[i + 1]`."""

    start: cla.Array
    rows: cla.Array
    """[entries] int32."""
    weights: cla.Array
    """[entries, 4]."""


@dataclass(frozen=True, eq=False)
class _Rows:
    """(Gaussian, tile) pairs that are drawn, contiguous by tile; int32."""

    count: int
    gaussians: cla.Array
    """[rows]."""
    of_tile: cla.Array
    """[tiles + 1] first row of each tile."""
    order: cla.Array
    """[rows] rows by Gaussian, then tile."""
    of_gaussian: cla.Array
    """[n + 1] first position of each Gaussian in `order`."""


@dataclass(frozen=True, eq=False)
class BakedView:
    """W of one view."""

    device: Device
    size: tuple[int, int]
    visible: cla.Array
    """[n] uint8, 1 where a Gaussian has any weight."""
    _entries: _Entries
    _rows: _Rows

    @property
    def nbytes(self) -> int:
        """Memory that the view holds."""
        entries, rows = self._entries, self._rows
        arrays = (
            entries.start, entries.rows, entries.weights, rows.gaussians, rows.of_tile, rows.order,
            rows.of_gaussian, self.visible,
        )  # fmt: skip
        return sum(int(array.nbytes) for array in arrays)

    @property
    def nonzeros(self) -> int:
        """(Gaussian, pixel) pairs that are drawn."""
        return int(np.count_nonzero(self._entries.weights.get()))

    def halved(self) -> BakedView:
        """The same with weights of 16 bits: 12 bytes an entry instead of 20, error 2e-4."""
        weights = self._entries.weights.get().astype(np.float16)
        return replace(self, _entries=replace(self._entries, weights=self.device.array(weights)))

    def render(self, lights: cla.Array, image: cla.Array) -> None:
        """`image` [h, w, C] = W · `lights` [n, C], which was made by `padded`."""
        entries, kernels = self._entries, self._kernels(int(lights.shape[-1]))
        self.device.launch(
            kernels.weights_render, self._tiles, *self._grid, entries.start, entries.rows,
            entries.weights, self._rows.gaussians, lights, image, group=1,
        )  # fmt: skip

    def gather(self, d_image: cla.Array, d_lights: cla.Array) -> None:
        """`d_lights` [n, C] = Wᵀ · `d_image` [h, w, C], which was made by `padded_zeros`."""
        device, entries, rows = self.device, self._entries, self._rows
        n, channels = d_lights.shape
        kernels = self._kernels(int(channels))
        partials = device.empty((max(rows.count, 1), _stride(int(channels))))
        device.launch(
            kernels.weights_gather, self._tiles, *self._grid, entries.start, entries.rows,
            entries.weights, rows.of_tile, d_image, partials, group=1,
        )  # fmt: skip
        device.launch(
            kernels.weights_sum, int(n), int(n), rows.of_gaussian, rows.order, partials, d_lights,
            group=64,
        )  # fmt: skip

    def _kernels(self, channels: int) -> Kernels:
        half = self._entries.weights.dtype == np.float16
        defines = {
            "CHANNELS": channels, "TILE": TILE, "GROUP_VECTORS": GROUP_VECTORS, "HALF_WEIGHTS": half
        }  # fmt: skip
        return self.device.program("weights_apply", defines)

    @property
    def _tiles(self) -> int:
        return int(self._rows.of_tile.shape[0]) - 1

    @property
    def _grid(self) -> tuple[np.ndarray, int]:
        """Image size and columns of tiles, as the kernels take them."""
        height, width = self.size
        return np.array([width, height], np.int32), -(-width // TILE)


def bake(device: Device, out: RasterOutput) -> BakedView:
    """The weights with which a forward pass blended its Gaussians."""
    return _fill(device, _count(device, out))


def bake_within(device: Device, out: RasterOutput, limit_bytes: int) -> BakedView | None:
    """The same, or None where the view would hold more than `limit_bytes`: it is never made."""
    counts = _count(device, out)
    return _fill(device, counts) if counts.nbytes <= limit_bytes else None


@dataclass(frozen=True, eq=False)
class _Counts:
    """How many weights a forward pass has, known before there is memory for them."""

    out: RasterOutput
    start: Int[np.ndarray, " quads1"]
    is_drawn: Bool[np.ndarray, " pairs"]

    @property
    def nbytes(self) -> int:
        """`BakedView.nbytes` of the baked view."""
        entries, rows = max(int(self.start[-1]), 1), int(self.is_drawn.sum())
        tiles, n = len(self.start) // QUADS, self.out.inputs.count
        # An entry is a row and four weights, a row a Gaussian and its place in the order.
        return self.start.nbytes + 20 * entries + 8 * rows + 4 * (tiles + 1) + 4 * (n + 1) + n


def _count(device: Device, out: RasterOutput) -> _Counts:
    _, tiles = tile_grid(out.camera)
    counts = device.empty((tiles * QUADS,), np.int32)
    drawn = device.zeros((max(out.saved.lists.pairs, 1),), np.uint8)
    device.launch(_baking(device, 0).weights_bake, tiles, *_lists(out), counts, drawn, group=1)
    return _Counts(out, _starts(counts.get()), drawn.get().astype(bool))


def _fill(device: Device, counts: _Counts) -> BakedView:
    out, start = counts.out, counts.start
    _, tiles = tile_grid(out.camera)
    entries = _Entries(
        device.array(start),
        device.empty((max(int(start[-1]), 1),), np.int32),
        device.empty((max(int(start[-1]), 1), 4)),
    )
    pair_rows = device.array(_starts(counts.is_drawn)[:-1])
    device.launch(
        _baking(device, 1).weights_bake, tiles, *_lists(out), entries.start, pair_rows,
        entries.rows, entries.weights, group=1,
    )  # fmt: skip
    rows, visible = _rows(device, out, counts.is_drawn)
    return BakedView(device, (out.camera.height, out.camera.width), visible, entries, rows)


def _lists(out: RasterOutput) -> tuple[object, ...]:
    """What both baking kernels read of a forward pass: its size and its Gaussians by tile."""
    columns, _ = tile_grid(out.camera)
    size = np.array([out.camera.width, out.camera.height], np.int32)
    return size, columns, out.saved.ranges, out.saved.sorted_ids, out.saved.records


def _rows(
    device: Device, out: RasterOutput, is_drawn: Bool[np.ndarray, " pairs"]
) -> tuple[_Rows, cla.Array]:
    """The rows, and which Gaussians have any."""
    saved, n = out.saved, out.inputs.count
    gaussians = saved.sorted_ids.get()[is_drawn]
    first_pair = saved.ranges.get()[:, 0]
    of_tile = np.append(_starts(is_drawn)[first_pair], np.int32(len(gaussians)))
    per_gaussian = np.bincount(gaussians, minlength=n)
    rows = _Rows(
        count=len(gaussians),
        gaussians=device.array(gaussians),
        of_tile=device.array(of_tile.astype(np.int32)),
        order=device.array(np.argsort(gaussians, kind="stable").astype(np.int32)),
        of_gaussian=device.array(_starts(per_gaussian)),
    )
    return rows, device.array((per_gaussian > 0).astype(np.uint8))


def _starts(counts: np.ndarray) -> np.ndarray:
    """[k + 1] int32 sums of the counts before each, and of all."""
    return np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]).astype(np.int32)


def _stride(channels: int) -> int:
    """Floats of a row of partial sums: whole equal groups of float8s."""
    vectors = -(-channels // 8)
    groups = -(-vectors // GROUP_VECTORS)
    return 8 * groups * -(-vectors // groups)


def _baking(device: Device, fill: int) -> Kernels:
    return device.program("weights_bake", RasterConfig().defines() | {"CHUNK": CHUNK, "FILL": fill})
