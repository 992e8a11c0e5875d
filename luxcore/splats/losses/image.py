"""L1 + D-SSIM of an image with any number of channels, fused on the device."""

from __future__ import annotations

import numpy as np
import pyopencl.array as cla

from luxcore.splats.device import Device, Kernels
from luxcore.splats.losses.constants import SSIM_RADIUS

LANES = 8
"""Channels that a CPU handles at once; images of fewer go through memory pass by pass."""
STRIP = 64
"""Columns that one work-item of a CPU takes at most: its scratch about fits a 1 MB cache."""
ROWS, RING = 4, 5
"""Rows that it takes at once, and blocks of them that it keeps."""


class ImageLoss:
    """l1_weight · mean |x - y| + ssim_weight · (1 - SSIM) and its gradient.

    For images [height, width, channels] of about unit scale. Holds its work memory, so one object
    serves all views of one size: 11 floats per value with D-SSIM; on CPUs, with 8 channels or
    more, 0.25 MB per 8 channels and 64 columns.
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
        strips = device.mapping == "block" and channels >= LANES and ssim_weight
        self._way = _Strips(device, self.shape) if strips else _Passes(device, self.shape)

    def gradient(self, x: cla.Array, y: cla.Array, d_x: cla.Array) -> None:
        """Overwrite `d_x` with the gradient of the loss of `x` against the target `y`."""
        self._way(x, y, d_x, self.l1_weight / self.size, -self.ssim_weight / self.size)

    def value(self) -> float:
        """The loss at the last `gradient`; waits for the device."""
        l1, ssim = (total / self.size for total in self._way.sums())
        return self.l1_weight * l1 + self.ssim_weight * (1 - ssim)


class _Strips:
    """kernels/loss_image_strips.cl."""

    def __init__(self, device: Device, shape: tuple[int, int, int]) -> None:
        height, width, channels = shape
        strips = -(-width // STRIP)
        strip = _whole(-(-width // strips), 4)
        middle = _whole((strip + 2 * SSIM_RADIUS) * LANES, 4 * LANES)
        outer = middle + _whole(2 * SSIM_RADIUS * LANES, 4 * LANES)
        group = RING * ROWS * (2 * outer + 3 * middle)
        scratch = -(-channels // LANES) * group + ROWS * (4 * outer + 3 * middle)
        defines = {
            "HEIGHT": height, "WIDTH": width, "CHANNELS": channels, "STRIP": strip,
            "SCRATCH": scratch,
        }  # fmt: skip
        self.device, self._work_items = device, strips
        self._kernels: Kernels = device.program("loss_image_strips", defines)
        self._scratch = device.empty((self._work_items * scratch,))
        self._sums = device.zeros((self._work_items, 2))

    def __call__(
        self, x: cla.Array, y: cla.Array, d_x: cla.Array, l1_scale: float, ssim_scale: float
    ) -> None:
        self.device.launch(
            self._kernels.image_loss, self._work_items, x, y, l1_scale, ssim_scale, self._scratch,
            d_x, self._sums, group=1,
        )  # fmt: skip

    def sums(self) -> tuple[float, float]:
        """Σ |x - y| and Σ SSIM."""
        l1, ssim = self._sums.get().sum(axis=0, dtype=np.float64)
        return float(l1), float(ssim)


class _Passes:
    """kernels/loss_image.cl."""

    def __init__(self, device: Device, shape: tuple[int, int, int]) -> None:
        height, width, channels = shape
        row, pad = width * channels, SSIM_RADIUS * channels
        blocks = -(-row // 16)
        stride = 16 * blocks + 2 * pad
        defines = {
            "HEIGHT": height, "ROW": row, "CHANNELS": channels, "PAD": pad, "STRIDE": stride,
            "BLOCKS": blocks,
        }  # fmt: skip
        self.device = device
        self._kernels: Kernels = device.program("loss_image", defines)
        self._work_items = blocks * height
        self._l1_sums = device.zeros((height, blocks))
        self._ssim_sums = device.zeros((height, blocks))
        self._planes_shape, self._partials_shape = (5, height, stride), (3, height, row)
        self._planes: cla.Array | None = None

    def __call__(
        self, x: cla.Array, y: cla.Array, d_x: cla.Array, l1_scale: float, ssim_scale: float
    ) -> None:
        launch, kernels, work_items = self.device.launch, self._kernels, self._work_items
        if not ssim_scale:
            launch(kernels.gradient_l1, work_items, x, y, l1_scale, d_x, self._l1_sums)
            return
        if self._planes is None:
            self._planes = self.device.zeros(self._planes_shape)
            self._partials = self.device.empty(self._partials_shape)
        planes, partials = self._planes, self._partials
        launch(kernels.moments_columns, work_items, x, y, planes)
        launch(kernels.ssim_rows, work_items, planes, partials, self._ssim_sums)
        launch(kernels.partials_columns, work_items, partials, planes)
        launch(
            kernels.gradient_rows, work_items, x, y, planes, l1_scale, ssim_scale, d_x,
            self._l1_sums,
        )  # fmt: skip

    def sums(self) -> tuple[float, float]:
        """Σ |x - y| and Σ SSIM."""
        l1, ssim = (float(s.get().sum(dtype=np.float64)) for s in (self._l1_sums, self._ssim_sums))
        return l1, ssim


def _whole(floats: int, step: int) -> int:
    return -(-floats // step) * step
