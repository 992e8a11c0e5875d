"""L1 + D-SSIM of an image with any number of channels, fused on the device."""

from __future__ import annotations

import numpy as np
import pyopencl.array as cla

from luxcore.splats.device import Device, Kernels
from luxcore.splats.losses.constants import SSIM_RADIUS


class ImageLoss:
    """l1_weight · mean |x - y| + ssim_weight · (1 - SSIM) and its gradient.

    For images [height, width, channels] of about unit scale. Holds its work memory (11 floats per
    value with D-SSIM), so one object serves all views of one size.
    """

    def __init__(
        self,
        device: Device,
        size: tuple[int, int],
        channels: int,
        l1_weight: float,
        ssim_weight: float,
    ) -> None:
        height, width = size
        self.device, self.size = device, height * width * channels
        self.shape = (height, width, channels)
        self.l1_weight, self.ssim_weight = l1_weight, ssim_weight
        row = width * channels
        pad = SSIM_RADIUS * channels
        blocks = -(-row // 16)
        stride = 16 * blocks + 2 * pad
        defines = {
            "HEIGHT": height, "ROW": row, "CHANNELS": channels, "PAD": pad, "STRIDE": stride,
            "BLOCKS": blocks,
        }  # fmt: skip
        self._kernels: Kernels = device.program("loss_image", defines)
        self._work_items = blocks * height
        self._l1_sums = device.zeros((height, blocks))
        self._ssim_sums = device.zeros((height, blocks))
        if ssim_weight:
            self._planes = device.zeros((5, height, stride))
            self._partials = device.empty((3, height, row))

    def gradient(self, x: cla.Array, y: cla.Array, d_x: cla.Array) -> None:
        """Overwrite `d_x` with the gradient of the loss of `x` against the target `y`."""
        launch, kernels, work_items = self.device.launch, self._kernels, self._work_items
        l1_scale = self.l1_weight / self.size
        if not self.ssim_weight:
            launch(kernels.gradient_l1, work_items, x, y, l1_scale, d_x, self._l1_sums)
            return
        planes, partials = self._planes, self._partials
        launch(kernels.moments_columns, work_items, x, y, planes)
        launch(kernels.ssim_rows, work_items, planes, partials, self._ssim_sums)
        launch(kernels.partials_columns, work_items, partials, planes)
        launch(
            kernels.gradient_rows, work_items, x, y, planes, l1_scale,
            -self.ssim_weight / self.size, d_x, self._l1_sums,
        )  # fmt: skip

    def value(self) -> float:
        """The loss at the last `gradient`; waits for the device."""
        l1 = float(self._l1_sums.get().sum(dtype=np.float64)) / self.size
        ssim = float(self._ssim_sums.get().sum(dtype=np.float64)) / self.size
        return self.l1_weight * l1 + self.ssim_weight * (1 - ssim)
