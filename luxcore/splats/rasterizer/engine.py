"""The rasterizer: projection, binning, blending, and their derivatives, on one OpenCL device."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pyopencl.array as cla

from luxcore.cameras import Camera
from luxcore.splats.device import Device
from luxcore.splats.rasterizer.binning import Binning
from luxcore.splats.rasterizer.blending import Blending
from luxcore.splats.rasterizer.config import RasterConfig
from luxcore.splats.rasterizer.output import (
    GaussianArrays,
    RasterGradients,
    RasterOutput,
    SavedForBackward,
)

LANES = {"block": 16, "pixel": 1}
"""Gaussians that one work-item projects."""
GROUP = 64


class Rasterizer:
    """Forward and backward for one device and one configuration; see the package docstring."""

    def __init__(self, device: Device, config: RasterConfig) -> None:
        self.device, self.config = device, config
        self._lanes = LANES[device.mapping]
        defines = config.defines() | {"LANES": self._lanes}
        self._projection = device.program("projection", defines)
        self._projection_backward = device.program("projection_backward", defines)
        self._binning = Binning(device, config)
        self._blending = Blending(device, config)

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
        records, radii = device.empty((n, 8)), device.empty((n,), np.int32)
        depth_keys, tile_counts = device.empty((n,), np.uint32), device.empty((n,), np.int32)
        device.launch(
            self._projection.project_gaussians, -(-n // self._lanes), n,
            *_camera_arguments(camera), means, quats, log_scales, opacity_logits, records,
            depth_keys, tile_counts, radii, group=GROUP,
        )  # fmt: skip
        lists = self._binning(camera, records, depth_keys, tile_counts)
        image, alpha, depth, used = self._blending.forward(camera, lists, records, colors)
        saved = SavedForBackward(records, lists, used)
        return RasterOutput(image, alpha, depth, radii, camera, inputs, saved)

    def backward(
        self,
        out: RasterOutput,
        d_image: cla.Array,
        d_alpha: cla.Array | None = None,
        d_depth: cla.Array | None = None,
    ) -> RasterGradients:
        """Gradients of a loss whose derivatives by `out.image`, `.alpha`, `.depth` are given."""
        device, inputs, n = self.device, out.inputs, out.inputs.count
        moments, d_colors = self._blending.backward(out, d_image, d_alpha, d_depth)
        gradients = RasterGradients(
            means=device.empty((n, 3)),
            quats=device.empty((n, 4)),
            log_scales=device.empty((n, 3)),
            opacity_logits=device.empty((n,)),
            colors=d_colors,
            mean2d_norm=device.empty((n,)),
            visible=device.empty((n,), np.uint8),
        )
        device.launch(
            self._projection_backward.project_gaussians_backward, -(-n // self._lanes), n,
            *_camera_arguments(out.camera), inputs.means, inputs.quats, inputs.log_scales,
            inputs.opacity_logits, out.radii, moments, gradients.means, gradients.quats,
            gradients.log_scales, gradients.opacity_logits, gradients.mean2d_norm,
            gradients.visible, group=GROUP,
        )  # fmt: skip
        return gradients

    def recolor(self, out: RasterOutput, colors: cla.Array) -> RasterOutput:
        """The same view with other colours [n, channels]: geometry and sorted lists are reused."""
        inputs = replace(out.inputs, colors=colors)
        self._check(inputs)
        saved = out.saved
        image, alpha, depth, used = self._blending.forward(
            out.camera, saved.lists, saved.records, colors
        )
        saved = SavedForBackward(saved.records, saved.lists, used)
        return RasterOutput(image, alpha, depth, out.radii, out.camera, inputs, saved)

    def color_gradients(self, out: RasterOutput, d_image: cla.Array) -> cla.Array:
        """Gradient by the colours [n, channels] alone: what frozen geometry needs."""
        return self._blending.color_gradients(out, d_image)

    def _check(self, inputs: GaussianArrays) -> None:
        n = inputs.count
        expected = {
            "means": (n, 3),
            "quats": (n, 4),
            "log_scales": (n, 3),
            "opacity_logits": (n,),
            "colors": (n, self.config.channels),
        }
        for name, shape in expected.items():
            array = getattr(inputs, name)
            if array.shape != shape or array.dtype != np.float32:
                raise ValueError(
                    f"{name} must be float32 of shape {shape}, got {array.dtype} {array.shape}."
                )


def _camera_arguments(camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    view = camera.viewmat.astype(np.float32).reshape(16)
    intrinsics = np.array([camera.fx, camera.fy, camera.cx, camera.cy], np.float32)
    return view, intrinsics, np.array([camera.width, camera.height], np.int32)
