"""Which Gaussians each tile blends, in the order (depth, index): kernels/sort.cl.

Gaussians are sorted by depth once, then dealt to tiles by a counting sort. Both are stable.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl as cl
import pyopencl.array as cla

from luxcore.cameras import Camera
from luxcore.errors import LuxError
from luxcore.splats.device import Device
from luxcore.splats.rasterizer.config import TILE, RasterConfig

DIGIT_BITS = 11
"""Three passes sort 32-bit keys; 2048 counters fit the first cache."""
PARTS = {"block": 16, "pixel": 256}
"""Contiguous parts that are counted and moved at once. The result does not depend on it."""
SCAN_ITEMS = {"block": 1, "pixel": 256}


@dataclass(frozen=True, eq=False)
class TileLists:
    """Sorted (Gaussian, tile) pairs; arrays are int32."""

    ranges: cla.Array
    """[tiles, 2] first and end position of each tile, rows of tiles from the top left."""
    sorted_ids: cla.Array
    """[pairs] Gaussian at each position."""
    slot_positions: cla.Array
    """[pairs] position of each slot; a Gaussian's slots are contiguous, in the order of tiles."""
    order: cla.Array
    """[n] Gaussians by depth, ties by index."""
    offsets: cla.Array
    """[n + 1] first slot of each Gaussian, in the order of `order`."""
    pairs: int


def tile_grid(camera: Camera) -> tuple[int, int]:
    """(columns, number) of tiles."""
    columns, rows = -(-camera.width // TILE), -(-camera.height // TILE)
    return columns, columns * rows


class Binning:
    """The sort of one device and configuration."""

    def __init__(self, device: Device, config: RasterConfig) -> None:
        self.device, self.config = device, config
        self.parts, self.scan_items = PARTS[device.mapping], SCAN_ITEMS[device.mapping]
        extra = {"PARTS": self.parts, "DIGIT_BITS": DIGIT_BITS}
        self._kernels = device.program("sort", config.defines() | extra)

    def __call__(
        self, camera: Camera, records: cla.Array, depth_keys: cla.Array, tile_counts: cla.Array
    ) -> TileLists:
        """Lists for `camera` from what the projection wrote.

        Raises LuxError when there are more than `config.max_intersections` pairs.
        """
        device, kernels, n = self.device, self._kernels, int(records.shape[0])
        _, tiles = tile_grid(camera)
        size = np.array([camera.width, camera.height], np.int32)
        order = self._depth_order(depth_keys)
        part_pairs = device.empty((self.parts,), np.uint64)
        device.launch(kernels.count_pairs, self.parts, n, order, tile_counts, part_pairs, group=1)
        pairs = self._checked(int(part_pairs.get().sum()))
        offsets, slot_tiles = self._ints(n + 1), self._ints(pairs)
        table = self._ints(self.parts * tiles)
        device.launch(
            kernels.list_tiles, self.parts, n, tiles, size, order, tile_counts, part_pairs,
            records, offsets, slot_tiles, table, group=1,
        )  # fmt: skip
        self._scan(table, tiles)
        ranges = device.empty((tiles, 2), np.int32)
        device.launch(kernels.find_ranges, tiles, tiles, pairs, table, ranges, group=64)
        ids, positions = self._ints(pairs), self._ints(pairs)
        device.launch(
            kernels.move_to_tiles, self.parts, n, tiles, order, offsets, slot_tiles,
            table, ids, positions, group=1,
        )  # fmt: skip
        return TileLists(ranges, ids, positions, order, offsets, pairs)

    def _depth_order(self, keys: cla.Array) -> cla.Array:
        """Indices by ascending key, ties by index (radix sort, least significant digit first)."""
        device, kernels, n = self.device, self._kernels, int(keys.shape[0])
        table = self._ints(self.parts << DIGIT_BITS)
        values: cla.Array | None = None
        for shift in range(0, 32, DIGIT_BITS):
            keys_out, values_out = device.empty((max(n, 1),), np.uint32), self._ints(n)
            device.launch(kernels.count_digits, self.parts, n, shift, keys, table, group=1)
            self._scan(table, 1 << DIGIT_BITS)
            device.launch(
                kernels.move_by_digit, self.parts, n, shift, keys, values, table, keys_out,
                values_out, group=1,
            )  # fmt: skip
            keys, values = keys_out, values_out
        assert values is not None
        return values

    def _scan(self, table: cla.Array, bins: int) -> None:
        local = cl.LocalMemory(4 * self.scan_items)
        self.device.launch(
            self._kernels.scan_table, self.scan_items, bins, table, local, group=self.scan_items
        )

    def _ints(self, count: int) -> cla.Array:
        return self.device.empty((max(count, 1),), np.int32)

    def _checked(self, pairs: int) -> int:
        if pairs > self.config.max_intersections:
            raise LuxError(
                f"the view has {pairs} intersections of Gaussians and tiles, more than the bound "
                f"of {self.config.max_intersections}: some Gaussians are far too large."
            )
        return pairs
