"""The rasterizer: projection, binning, blending, and their derivatives, on one OpenCL device."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl.array as cla

from luxcore.cameras import Camera
from luxcore.splats.device import Device
from luxcore.splats.rasterizer.config import TILE, RasterConfig
from luxcore.splats.rasterizer.output import GaussianArrays, RasterGradients, RasterOutput


@dataclass(frozen=True, eq=False)
class Saved:
    """What blending read, kept for the backward pass."""

    records: cla.Array
    ranges: cla.Array
    sorted_ids: cla.Array
    sorted_slots: cla.Array
    offsets: cla.Array
    counts: cla.Array


class Rasterizer:
    """Forward and backward for one device and one configuration; see the package docstring."""

    def __init__(self, device: Device, config: RasterConfig) -> None:
        self.device, self.config = device, config
        defines = config.defines()
        self._projection = device.program("projection", defines)
        self._raster = device.program("raster_block", defines)

    def forward(
        self,
        camera: Camera,
        means: cla.Array,
        quats: cla.Array,
        log_scales: cla.Array,
        opacity_logits: cla.Array,
        colors: cla.Array,
    ) -> RasterOutput:
        """The view of `camera`, on a black background."""
        inputs = GaussianArrays(means, quats, log_scales, opacity_logits, colors)
        self._check(inputs)
        device, n = self.device, inputs.count
        height, width = camera.height, camera.width
        records, rects = device.zeros((n, 8)), device.zeros((n, 4), np.int32)
        radii = device.zeros((n,), np.int32)
        device.launch(
            self._projection.project_gaussians, n, n, *_camera_arguments(camera), means, quats,
            log_scales, opacity_logits, records, rects, radii,
        )  # fmt: skip
        saved, total = self._bin(camera, records, rects)
        image = device.empty((height, width, self.config.channels))
        alpha, depth = device.empty((height, width)), device.empty((height, width))
        tiles_x, tiles = _tiles(camera)
        device.launch(
            self._raster.raster_forward, tiles, _size(camera), tiles_x, saved.ranges,
            saved.sorted_ids, records, colors, image, alpha, depth, group=1,
        )  # fmt: skip
        return RasterOutput(image, alpha, depth, radii, total, camera, inputs, saved)

    def backward(
        self,
        out: RasterOutput,
        d_image: cla.Array,
        d_alpha: cla.Array | None = None,
        d_depth: cla.Array | None = None,
    ) -> RasterGradients:
        """Gradients of a loss whose derivatives by `out.image`, `.alpha`, `.depth` are given."""
        device, inputs, saved = self.device, out.inputs, out.saved
        n, channels, camera = inputs.count, self.config.channels, out.camera
        slots = device.empty((max(out.intersections, 1), 7 + channels))
        d_alpha = d_alpha if d_alpha is not None else device.zeros(out.alpha.shape)
        d_depth = d_depth if d_depth is not None else device.zeros(out.depth.shape)
        grads = RasterGradients(
            device.empty((n, 3)), device.empty((n, 4)), device.empty((n, 3)), device.empty((n,)),
            device.empty((n, channels)), device.empty((n,)),
            (out.radii > 0).astype(np.uint8) if n else device.empty((0,), np.uint8),
        )  # fmt: skip
        tiles_x, tiles = _tiles(camera)
        device.launch(
            self._raster.raster_backward, tiles, _size(camera), tiles_x, saved.ranges,
            saved.sorted_ids, saved.sorted_slots, saved.records, inputs.colors, out.image,
            out.alpha, out.depth, d_image, d_alpha, d_depth, slots, group=1,
        )  # fmt: skip
        d_records = device.empty((n, 8))
        device.launch(
            self._raster.reduce_slots, n, n, saved.offsets, saved.counts, slots, d_records,
            grads.colors,
        )  # fmt: skip
        device.launch(
            self._projection.project_gaussians_backward, n, n, *_camera_arguments(camera),
            inputs.means, inputs.quats, inputs.log_scales, inputs.opacity_logits, out.radii,
            d_records, grads.means, grads.quats, grads.log_scales, grads.opacity_logits,
            grads.mean2d_norm,
        )  # fmt: skip
        return grads

    def _bin(self, camera: Camera, records: cla.Array, rects: cla.Array) -> tuple[Saved, int]:
        device = self.device
        tiles_x, tiles = _tiles(camera)
        host_rects, depth = rects.get(), records.get()[:, 6]
        spans = np.maximum(host_rects[:, 2:] - host_rects[:, :2], 0)
        counts = spans[:, 0] * spans[:, 1]
        offsets = np.cumsum(counts) - counts
        total = int(counts.sum())
        ids = np.repeat(np.arange(len(counts)), counts)
        inner = np.arange(total) - offsets[ids]
        tile = (host_rects[ids, 1] + inner // np.maximum(spans[ids, 0], 1)) * tiles_x
        tile += host_rects[ids, 0] + inner % np.maximum(spans[ids, 0], 1)
        order = np.lexsort((ids, depth[ids], tile))
        bounds = np.searchsorted(tile[order], np.arange(tiles + 1))
        ranges = np.stack([bounds[:-1], bounds[1:]], 1)
        padded = order if total else np.zeros(1, np.int64)
        sorted_ids = ids[order] if total else padded
        as_device = [a.astype(np.int32) for a in (ranges, sorted_ids, padded, offsets, counts)]
        return Saved(records, *(device.array(a) for a in as_device)), total

    def _check(self, inputs: GaussianArrays) -> None:
        n = inputs.count
        expected = {
            "means": (n, 3), "quats": (n, 4), "log_scales": (n, 3), "opacity_logits": (n,),
            "colors": (n, self.config.channels),
        }  # fmt: skip
        for name, shape in expected.items():
            array = getattr(inputs, name)
            if array.shape != shape or array.dtype != np.float32:
                raise ValueError(
                    f"{name} must be float32 of shape {shape}, got {array.dtype} {array.shape}."
                )


def _tiles(camera: Camera) -> tuple[int, int]:
    tiles_x, tiles_y = -(-camera.width // TILE), -(-camera.height // TILE)
    return tiles_x, tiles_x * tiles_y


def _size(camera: Camera) -> np.ndarray:
    return np.array([camera.width, camera.height], np.int32)


def _camera_arguments(camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    view = camera.viewmat.astype(np.float32).reshape(16)
    intrinsics = np.array([camera.fx, camera.fy, camera.cx, camera.cy], np.float32)
    return view, intrinsics, _size(camera)
