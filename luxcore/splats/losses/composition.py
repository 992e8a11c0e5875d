"""Consistency of the recombined lights with the photo, through a learnt tone curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl.array as cla
from jaxtyping import Float

from luxcore.splats.device import Device
from luxcore.splats.losses.constants import BETA_MIN, CLIPPED, GAMMA_MAX, GAMMA_MIN
from luxcore.splats.losses.sums import column_sums


@dataclass(frozen=True)
class ToneCurve:
    """T(v) = (v + beta)^(1/gamma): linear light around one to display values."""

    beta: float
    gamma: float


START_CURVE = ToneCurve(beta=0.002, gamma=2.2)
"""Where learning starts: about what a display does."""


def raw_parameters(weights: Float[np.ndarray, "m 3"], curve: ToneCurve) -> Float[np.ndarray, " p"]:
    """What the kernel learns: w as it is, β before its softplus, γ before its sigmoid."""
    raw_beta = np.log(np.expm1(max(curve.beta - BETA_MIN, 1e-6)))
    share = np.clip((curve.gamma - GAMMA_MIN) / (GAMMA_MAX - GAMMA_MIN), 1e-6, 1 - 1e-6)
    raw_gamma = np.log(share / (1 - share))
    return np.concatenate([weights.ravel(), [raw_beta, raw_gamma]]).astype(np.float32)


def read_parameters(
    raw: Float[np.ndarray, " p"],
) -> tuple[Float[np.ndarray, "m 3"], ToneCurve]:
    """The inverse of `raw_parameters`."""
    beta = BETA_MIN + float(np.logaddexp(0, raw[-2]))
    gamma = GAMMA_MIN + (GAMMA_MAX - GAMMA_MIN) / (1 + float(np.exp(-raw[-1])))
    return raw[:-2].reshape(-1, 3), ToneCurve(beta, gamma)


class CompositionLoss:
    """weight · mean |T(Σ_m w_m x_m unit_m) - photo| and its gradients by x, w, β and γ."""

    def __init__(
        self, device: Device, size: tuple[int, int], units: Float[np.ndarray, " m"], weight: float
    ) -> None:
        height, width = size
        self.device, self.weight, self.lights = device, weight, len(units)
        self._scale = weight / (height * width * 3)
        defines = {
            "HEIGHT": height, "WIDTH": width, "LIGHTS": self.lights, "BETA_MIN": BETA_MIN,
            "GAMMA_MIN": GAMMA_MIN, "GAMMA_MAX": GAMMA_MAX, "CLIPPED": CLIPPED,
        }  # fmt: skip
        self._kernel = device.program("loss_composition", defines).composition_rows
        self._units = device.array(units.astype(np.float32))
        columns = 3 * self.lights + 3
        self._partials = device.zeros((height, columns))
        self._sums = device.zeros((columns,))
        self._height = height
        self.d_params = self._sums[: columns - 1]
        """Gradient by the raw parameters, [3M + 2], of the last `gradient`."""

    def gradient(self, x: cla.Array, photo: cla.Array, params: cla.Array, d_x: cla.Array) -> None:
        """Add to `d_x` [h, w, 3M] and set `d_params`."""
        self.device.launch(
            self._kernel, self._height, x, photo, params, self._units, self._scale, d_x,
            self._partials, group=1,
        )  # fmt: skip
        column_sums(self.device, self._partials, self._sums)

    def value(self) -> float:
        """The loss at the last `gradient`; waits for the device."""
        return float(self._sums.get()[-1]) * self._scale
