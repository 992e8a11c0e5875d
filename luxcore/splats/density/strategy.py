"""What a strategy of density control is: an object that adds, moves and removes Gaussians."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Int

from luxcore.splats.gaussians import Gaussians
from luxcore.splats.model import DeviceGaussians
from luxcore.splats.rasterizer import RasterGradients, RasterOutput


@dataclass(frozen=True)
class Edit:
    """A new population. Gaussian i comes from `parents[i]` of the old one.

    Where `fresh`, the optimizer forgets its moments; elsewhere it keeps those of the parent.
    """

    gaussians: Gaussians
    parents: Int[np.ndarray, " n"]
    fresh: Bool[np.ndarray, " n"]

    def take(self, index: np.ndarray) -> Edit:
        """The part of the new population at `index` (positions or a mask), in that order."""
        return Edit(self.gaussians.take(index), self.parents[index], self.fresh[index])


@runtime_checkable
class Strategy(Protocol):
    """Called by the fit at fixed points of each iteration; deterministic given its arguments."""

    def before_step(self, model: DeviceGaussians, gradients: RasterGradients) -> None:
        """May add regularizers to the gradients, on the device."""

    def after_step(
        self, model: DeviceGaussians, out: RasterOutput, gradients: RasterGradients, iteration: int
    ) -> None:
        """May gather statistics or move the parameters, on the device."""

    def refine(
        self, model: DeviceGaussians, iteration: int, random: np.random.Generator
    ) -> Edit | None:
        """The population from here on, or None to leave it."""

    def state(self) -> dict[str, np.ndarray]:
        """What `load` needs to continue with the same bits."""

    def load(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue from `state`."""
