"""Blending of sorted Gaussians and its derivative, in the mapping of the device.

"block": one work-item per tile (kernels/raster_block_*.cl). "pixel": one work-item per pixel, a
work-group per tile (kernels/raster_pixel_*.cl). Both have the same arithmetic and arguments.
"""

from __future__ import annotations

import numpy as np
import pyopencl.array as cla

from luxcore.cameras import Camera
from luxcore.splats.device import Device
from luxcore.splats.rasterizer.binning import TileLists, tile_grid
from luxcore.splats.rasterizer.config import TILE, RasterConfig
from luxcore.splats.rasterizer.output import RasterOutput

CHUNK = {"block": 64, "pixel": TILE * TILE}
"""Gaussians of a tile that are held at once."""
GROUP = {"block": 1, "pixel": TILE * TILE}
"""Work-items per tile."""


class Blending:
    """The blending kernels of one device and configuration."""

    def __init__(self, device: Device, config: RasterConfig) -> None:
        self.device, self.config = device, config
        self._group = GROUP[device.mapping]
        self._forward = device.program(f"raster_{device.mapping}_forward", self._defines(True))

    def forward(
        self, camera: Camera, lists: TileLists, records: cla.Array, colors: cla.Array
    ) -> tuple[cla.Array, cla.Array, cla.Array, cla.Array]:
        """(image [h, w, C], alpha [h, w], depth [h, w], used [tiles] int32).

        `used` counts the Gaussians of a tile that were looked at before its pixels were finished.
        """
        device, (columns, tiles) = self.device, tile_grid(camera)
        height, width = camera.height, camera.width
        image = device.empty((height, width, self.config.channels))
        alpha, depth = device.empty((height, width)), device.empty((height, width))
        used = device.empty((tiles,), np.int32)
        device.launch(
            self._forward.raster_forward, tiles * self._group, _size(camera), columns,
            lists.ranges, lists.sorted_ids, records, colors, image, alpha, depth, used,
            group=self._group,
        )  # fmt: skip
        return image, alpha, depth, used

    def backward(
        self,
        out: RasterOutput,
        d_image: cla.Array,
        d_alpha: cla.Array | None,
        d_depth: cla.Array | None,
    ) -> tuple[cla.Array, cla.Array]:
        """(moments [n, 8] for kernels/projection_backward.cl, d_colors [n, C])."""
        with_depth = d_depth is not None
        defines = self._defines(with_depth)
        moments = self.device.empty((out.inputs.count, 8))
        upstream = (out.image, out.alpha, out.depth, d_image, d_alpha, d_depth)
        return moments, self._partials(out, defines, upstream, moments)

    def color_gradients(self, out: RasterOutput, d_image: cla.Array) -> cla.Array:
        """d_colors [n, C] alone; the blending weights are all it needs."""
        if self.device.mapping == "pixel":
            return self.backward(out, d_image, None, None)[1]
        defines = self._defines(False) | {
            "COLORS_ONLY": 1,
            "PARTIAL_SIZE": -(-self.config.channels // 4) * 4,
        }
        return self._partials(out, defines, (None, None, None, d_image, None, None), None)

    def _partials(
        self,
        out: RasterOutput,
        defines: dict[str, int | float | str],
        upstream: tuple[cla.Array | None, ...],
        moments: cla.Array | None,
    ) -> cla.Array:
        device, lists = self.device, out.saved.lists
        columns, tiles = tile_grid(out.camera)
        n, pairs = out.inputs.count, max(lists.pairs, 1)
        partials = device.empty((pairs, int(defines["PARTIAL_SIZE"])))
        touched = device.zeros((pairs,), np.uint8)
        kernels = device.program(f"raster_{device.mapping}_backward", defines)
        device.launch(
            kernels.raster_backward, tiles * self._group, _size(out.camera), columns, lists.ranges,
            lists.sorted_ids, out.saved.records, out.inputs.colors, out.saved.used, *upstream,
            partials, touched, group=self._group,
        )  # fmt: skip
        d_colors = device.empty((n, self.config.channels))
        gather = device.program("gather_partials", defines).gather_partials
        device.launch(
            gather, n, n, lists.order, lists.offsets, lists.slot_positions, partials, touched,
            moments, d_colors, group=64,
        )  # fmt: skip
        return d_colors

    def _defines(self, with_depth: bool) -> dict[str, int | float | str]:
        return self.config.defines() | {
            "CHUNK": CHUNK[self.device.mapping],
            "WITH_DEPTH": with_depth,
            "PARTIAL_SIZE": self.config.partial_size(with_depth),
        }


def _size(camera: Camera) -> np.ndarray:
    return np.array([camera.width, camera.height], np.int32)
