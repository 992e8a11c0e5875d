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
        }  # fmt: skip
        self._kernels: Kernels = device.program("loss_image", defines)
        self._grid = (blocks, height)
        self._l1_sums = device.zeros((height, blocks))
        self._ssim_sums = device.zeros((height, blocks))
        if ssim_weight:
            self._planes = device.zeros((5, height, stride))
            self._partials = device.empty((3, height, row))

    def gradient(self, x: cla.Array, y: cla.Array, d_x: cla.Array) -> None:
        """Overwrite `d_x` with the gradient of the loss of `x` against the target `y`."""
        queue, kernels = self.device.queue, self._kernels
        l1_scale = np.float32(self.l1_weight / self.size)
        if not self.ssim_weight:
            kernels.gradient_l1(
                queue, self._grid, None, x.data, y.data, l1_scale, d_x.data, self._l1_sums.data
            )
            return
        planes, partials = self._planes.data, self._partials.data
        kernels.moments_columns(queue, self._grid, None, x.data, y.data, planes)
        kernels.ssim_rows(queue, self._grid, None, planes, partials, self._ssim_sums.data)
        kernels.partials_columns(queue, self._grid, None, partials, planes)
        kernels.gradient_rows(
            queue, self._grid, None, x.data, y.data, planes, l1_scale,
            np.float32(-self.ssim_weight / self.size), d_x.data, self._l1_sums.data,
        )  # fmt: skip

    def value(self) -> float:
        """The loss at the last `gradient`; waits for the device."""
        l1 = float(self._l1_sums.get().sum(dtype=np.float64)) / self.size
        ssim = float(self._ssim_sums.get().sum(dtype=np.float64)) / self.size
        return self.l1_weight * l1 + self.ssim_weight * (1 - ssim)
