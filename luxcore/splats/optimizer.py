"""Adam on the device, for several parameter arrays with a learning rate each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pyopencl.array as cla

from luxcore.splats.device import Device


@dataclass(frozen=True)
class AdamSettings:
    """Moment decays and the epsilon of Adam."""

    beta1: float = 0.9
    beta2: float = 0.999
    epsilon: float = 1e-15


@dataclass
class Moments:
    """First and second moments of one parameter array, in its shape."""

    first: cla.Array
    second: cla.Array


class Adam:
    """Steps parameter arrays in place; rows that were not visible stay as they are."""

    def __init__(self, device: Device, settings: AdamSettings | None = None) -> None:
        self.device, self.settings = device, settings or AdamSettings()
        self.steps = 0
        self.moments: dict[str, Moments] = {}
        self._kernel = device.program("adam").adam

    def next_step(self) -> None:
        """Count one iteration; the bias correction is the same for all rows."""
        self.steps += 1

    def apply(
        self,
        name: str,
        values: cla.Array,
        gradients: cla.Array,
        visible: cla.Array,
        rate: float,
        *,
        lower: float = -np.inf,
        head: int | None = None,
        tail_rate: float = 0.0,
    ) -> None:
        """One step of the array called `name`, [n, …]; `visible` is [n] uint8.

        New values are never below `lower` (projection after the step). With `head`, both hold for
        the first `head` values of each row; the others step by `tail_rate`, unbounded.
        """
        if not values.size:
            return
        moments = self.moments.get(name)
        if moments is None:
            zeros = (self.device.zeros(values.shape) for _ in range(2))
            moments = self.moments[name] = Moments(*zeros)
        s = self.settings
        width = values.size // values.shape[0]
        self.device.launch(
            self._kernel, values.size, values, gradients, moments.first, moments.second, visible,
            width, values.size, width if head is None else head, rate, tail_rate, s.beta1, s.beta2,
            s.epsilon, 1 - s.beta1**self.steps, 1 - s.beta2**self.steps, lower,
        )  # fmt: skip

    def rearrange(self, parents: np.ndarray, fresh: np.ndarray) -> None:
        """Follow an edit of the population: row i continues `parents[i]`, or afresh."""
        for name, moments in self.moments.items():
            rows = []
            for array in (moments.first.get(), moments.second.get()):
                moved = array[parents]
                moved[fresh] = 0
                rows.append(self.device.array(moved))
            self.moments[name] = Moments(*rows)

    def forget(self, name: str) -> None:
        """Drop the moments of an array whose shape changes."""
        self.moments.pop(name, None)

    def state(self) -> dict[str, np.ndarray]:
        """Everything `load` needs, on the host."""
        state = {"steps": np.array([self.steps], np.int64)}
        for name, moments in self.moments.items():
            state[f"{name}.first"] = moments.first.get()
            state[f"{name}.second"] = moments.second.get()
        return state

    def load(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue from `state`."""
        self.steps = int(state["steps"][0])
        names = [key.removesuffix(".first") for key in state if key.endswith(".first")]
        for name in names:
            pair = (self.device.array(state[f"{name}.{part}"]) for part in ("first", "second"))
            self.moments[name] = Moments(*pair)
