"""The parameters of Gaussians on the device while they are being fitted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl.array as cla

from luxcore.splats.device import Device
from luxcore.splats.gaussians import Gaussians
from luxcore.splats.ply import MAX_LOGIT

GEOMETRY = ("means", "quats", "log_scales", "opacity_logits")


@dataclass
class DeviceGaussians:
    """The arrays of `Gaussians`, float32 on the device, stepped in place."""

    means: cla.Array
    quats: cla.Array
    log_scales: cla.Array
    opacity_logits: cla.Array
    sh: cla.Array
    antialiased: bool = False

    @classmethod
    def upload(cls, device: Device, gaussians: Gaussians) -> DeviceGaussians:
        """Copy to the device."""
        names = (*GEOMETRY, "sh")
        arrays = {name: device.array(getattr(gaussians, name)) for name in names}
        return cls(**arrays, antialiased=gaussians.antialiased)

    def download(self) -> Gaussians:
        """Copy to the host, with opacities kept off exactly 0 and 1."""
        return Gaussians(
            self.means.get(),
            self.quats.get(),
            self.log_scales.get(),
            np.clip(self.opacity_logits.get(), -MAX_LOGIT, MAX_LOGIT),
            self.sh.get(),
            self.antialiased,
        )

    @property
    def count(self) -> int:
        return int(self.means.shape[0])

    @property
    def geometry(self) -> tuple[cla.Array, cla.Array, cla.Array, cla.Array]:
        """What the rasterizer takes before the colours."""
        return self.means, self.quats, self.log_scales, self.opacity_logits
