"""Adaptive density control of 3DGS (Kerbl et al. 2023, section 5), with a cap on the count."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import pyopencl.array as cla
from jaxtyping import Bool, Float32

from luxcore.splats.density.quaternions import rotate
from luxcore.splats.density.strategy import Edit
from luxcore.splats.device import Device
from luxcore.splats.gaussians import Gaussians
from luxcore.splats.model import DeviceGaussians
from luxcore.splats.rasterizer import RasterGradients, RasterOutput

_SPLIT_SHRINK = 1.6
_RESET_OPACITY = 0.1
"""Far above the cut-off of 1/255, below which a Gaussian has no gradient and never returns."""


@dataclass(frozen=True)
class StandardSettings:
    """When and how much; sizes are shares of the scene's extent."""

    start: int
    stop: int
    every: int
    max_gaussians: int
    gradient_threshold: float = 2e-4
    split_size: float = 0.01
    prune_opacity: float = 0.01
    prune_size: float = 0.5
    reset_every: int = 0
    """Iterations between opacity resets; 0 is never."""


@dataclass
class _Statistics:
    """Device arrays [n]: gradient norm sums, times seen, largest radius in pixels."""

    norms: cla.Array
    seen: cla.Array
    radii: cla.Array


class StandardStrategy:
    """Clone what is small and pulled hard, split what is large and pulled hard, prune the rest."""

    def __init__(self, device: Device, extent: float, settings: StandardSettings) -> None:
        self.device, self.extent, self.settings = device, extent, settings
        self._kernel = device.program("density").accumulate
        self._statistics: _Statistics | None = None

    def before_step(self, model: DeviceGaussians, gradients: RasterGradients) -> None:
        """Nothing."""

    def after_step(
        self, model: DeviceGaussians, out: RasterOutput, gradients: RasterGradients, iteration: int
    ) -> None:
        """Gather statistics while there is a refinement to come."""
        n = model.count
        if iteration >= self.settings.stop or not n:
            return
        s = self._statistics
        if s is None:
            s = self._statistics = _Statistics(*(self.device.zeros((n,)) for _ in range(3)))
        self.device.launch(
            self._kernel, n, gradients.mean2d_norm, out.radii, gradients.visible, n, s.norms,
            s.seen, s.radii,
        )  # fmt: skip

    def refine(
        self, model: DeviceGaussians, iteration: int, random: np.random.Generator
    ) -> Edit | None:
        """Every `every` iterations between `start` and `stop`."""
        s = self.settings
        due = s.start <= iteration < s.stop and iteration % s.every == 0
        if not due or self._statistics is None:
            return None
        pull = self._statistics.norms.get() / np.maximum(self._statistics.seen.get(), 1)
        self._statistics = None
        gaussians = model.download()
        grown = _grow(gaussians, self._wants_more(gaussians, pull), self.extent, s, random)
        edit = _prune(grown, self.extent, s)
        if s.reset_every and iteration % s.reset_every == 0:
            edit = _reset(edit)
        return edit

    def state(self) -> dict[str, np.ndarray]:
        """The running statistics."""
        s = self._statistics
        return {} if s is None else {k: v.get() for k, v in vars(s).items()}

    def load(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue from `state`."""
        if state:
            arrays = {name: self.device.array(values) for name, values in state.items()}
            self._statistics = _Statistics(**arrays)

    def _wants_more(
        self, gaussians: Gaussians, pull: Float32[np.ndarray, " n"]
    ) -> Bool[np.ndarray, " n"]:
        """The Gaussians pulled hardest, no more of them than the cap leaves room for."""
        wanted = pull > self.settings.gradient_threshold
        room = max(self.settings.max_gaussians - len(gaussians), 0)
        if np.count_nonzero(wanted) > room:
            hardest = np.argsort(-pull, kind="stable")[:room]
            wanted = np.zeros(len(gaussians), bool)
            wanted[hardest] = True
        return wanted


def _grow(
    gaussians: Gaussians,
    wanted: Bool[np.ndarray, " n"],
    extent: float,
    settings: StandardSettings,
    random: np.random.Generator,
) -> Edit:
    """Every wanted Gaussian becomes two: a clone beside it, or two halves of a split."""
    large = np.exp(gaussians.log_scales).max(axis=1) > settings.split_size * extent
    split = wanted & large
    born = np.flatnonzero(wanted)
    parents = np.concatenate([np.arange(len(gaussians)), born])
    grown = gaussians.take(parents)
    halves = split[parents]
    means, log_scales = grown.means.copy(), grown.log_scales.copy()
    # Drawn inside the parent, so that needles are split along themselves.
    local = random.normal(size=(len(parents), 3)).astype(np.float32) * np.exp(log_scales)
    means[halves] += rotate(grown.quats[halves], local[halves])
    log_scales[halves] -= np.float32(np.log(_SPLIT_SHRINK))
    fresh = halves.copy()
    fresh[len(gaussians) :] = True
    return Edit(replace(grown, means=means, log_scales=log_scales), parents, fresh)


def _prune(edit: Edit, extent: float, settings: StandardSettings) -> Edit:
    """Drop what is nearly transparent, larger than the room, or no longer a number."""
    g = edit.gaussians
    opacity = 1 / (1 + np.exp(-g.opacity_logits.astype(np.float64)))
    size = np.exp(g.log_scales.astype(np.float64)).max(axis=1)
    numbers = np.concatenate([g.means, g.quats, g.log_scales, g.opacity_logits[:, None]], axis=1)
    keep = (opacity >= settings.prune_opacity) & (size <= settings.prune_size * extent)
    keep &= np.isfinite(numbers).all(axis=1)
    return edit.take(keep)


def _reset(edit: Edit) -> Edit:
    ceiling = np.float32(np.log(_RESET_OPACITY / (1 - _RESET_OPACITY)))
    logits = np.minimum(edit.gaussians.opacity_logits, ceiling)
    return replace(edit, gaussians=replace(edit.gaussians, opacity_logits=logits))
