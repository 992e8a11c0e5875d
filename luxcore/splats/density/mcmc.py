"""3DGS as Markov chain Monte Carlo (Kheradmand et al. 2024): relocate, add, and let them wander."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import comb

import numpy as np
from jaxtyping import Float, Int

from luxcore.splats.density.strategy import Edit
from luxcore.splats.device import Device
from luxcore.splats.gaussians import Gaussians
from luxcore.splats.model import DeviceGaussians
from luxcore.splats.rasterizer import RasterGradients, RasterOutput

_MAX_COPIES = 51
"""Copies that one Gaussian may be shared among at once, as in the authors' code."""


@dataclass(frozen=True)
class McmcSettings:
    """When and how much."""

    start: int
    stop: int
    every: int
    max_gaussians: int
    growth: float = 1.05
    """The population grows by this factor at each refinement, up to the cap."""
    dead_opacity: float = 0.005
    noise_rate: float = 5e5
    """Noise per iteration = noise_rate · (rate of the means) · covariance · normal numbers."""
    opacity_weight: float = 0.01
    scale_weight: float = 0.01


class McmcStrategy:
    """The dead are moved onto the living, noise explores, regularizers let the useless die."""

    def __init__(
        self, device: Device, extent: float, means_rate: float, seed: int, settings: McmcSettings
    ) -> None:
        self.device, self.extent, self.settings = device, extent, settings
        self._means_rate, self._seed = means_rate, seed
        self._kernels = device.program("density")

    def before_step(self, model: DeviceGaussians, gradients: RasterGradients) -> None:
        """Add the gradients of mean opacity and mean scale."""
        n, s = model.count, self.settings
        self.device.launch(
            self._kernels.mcmc_regularize, n, model.opacity_logits, model.log_scales, n,
            s.opacity_weight / max(n, 1), s.scale_weight / (3 * max(n, 1) * self.extent),
            gradients.opacity_logits, gradients.log_scales,
        )  # fmt: skip

    def after_step(
        self, model: DeviceGaussians, out: RasterOutput, gradients: RasterGradients, iteration: int
    ) -> None:
        """Shake the means until `stop`."""
        if iteration < self.settings.stop:
            self.shake(model, iteration)

    def shake(self, model: DeviceGaussians, iteration: int) -> None:
        """Move the means at random within their own shapes, the faint most."""
        n = model.count
        self.device.launch(
            self._kernels.mcmc_noise, n, *model.geometry, n, np.uint32(self._seed & 0xFFFFFFFF),
            np.uint32(iteration), self.settings.noise_rate * self._means_rate,
        )  # fmt: skip

    def refine(
        self, model: DeviceGaussians, iteration: int, random: np.random.Generator
    ) -> Edit | None:
        """Every `every` iterations between `start` and `stop`: relocate the dead, then grow."""
        s = self.settings
        if not (s.start <= iteration < s.stop and iteration % s.every == 0) or not model.count:
            return None
        gaussians = model.download()
        parents = self._parents(_opacity(gaussians), random)
        copies = np.bincount(parents, minlength=len(gaussians))
        shared = copies[parents] > 1
        fresh = shared | (parents != np.arange(len(parents)))
        return Edit(_share(gaussians.take(parents), copies[parents]), parents, fresh)

    def state(self) -> dict[str, np.ndarray]:
        """None: the noise is a function of seed and iteration."""
        return {}

    def load(self, state: Mapping[str, np.ndarray]) -> None:
        """Nothing to continue from."""

    def _parents(
        self, opacity: Float[np.ndarray, " n"], random: np.random.Generator
    ) -> Int[np.ndarray, " m"]:
        """Whom each Gaussian of the next population copies: the living are drawn ∝ opacity."""
        n = len(opacity)
        dead = opacity <= self.settings.dead_opacity
        if dead.all():
            return np.arange(n)
        target = min(int(n * self.settings.growth), max(self.settings.max_gaussians, n))
        parents = np.concatenate([np.arange(n), np.full(target - n, -1)])
        parents[:n][dead] = -1
        empty = parents < 0
        chances = np.where(dead, 0, opacity)
        drawn = random.choice(n, np.count_nonzero(empty), p=chances / chances.sum())
        parents[empty] = drawn
        return parents


def _opacity(gaussians: Gaussians) -> Float[np.ndarray, " n"]:
    return 1 / (1 + np.exp(-gaussians.opacity_logits.astype(np.float64)))


def _share(gaussians: Gaussians, copies: Int[np.ndarray, " n"]) -> Gaussians:
    """Opacity and scale of each of N copies, so that together they look like one (their eq. 9)."""
    copies = np.minimum(copies, _MAX_COPIES)
    old = np.clip(_opacity(gaussians), 1e-6, 1 - 1e-6)
    new = np.clip(1 - (1 - old) ** (1 / copies), 0.005, 1 - 1e-6)
    factor = old / _blend_sum(new, copies)
    many = copies > 1
    logits = np.where(many, np.log(new / (1 - new)), gaussians.opacity_logits)
    shift = np.where(many, np.log(np.clip(factor, 1e-3, 1.0)), 0)[:, None]
    return replace(
        gaussians,
        opacity_logits=logits.astype(np.float32),
        log_scales=(gaussians.log_scales + shift).astype(np.float32),
    )


def _blend_sum(
    opacity: Float[np.ndarray, " n"], copies: Int[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Σ_{i=1..N} Σ_{k=0..i-1} C(i-1, k) (-1)^k o^(k+1) / √(k+1)."""
    total = np.zeros(len(opacity))
    terms = np.zeros(len(opacity))
    for i in range(1, int(copies.max(initial=0)) + 1):
        # Alternating sums of binomials cancel; past twenty copies they are noise in float64.
        if i <= 20:
            terms = sum(
                comb(i - 1, k) * (-1.0) ** k * opacity ** (k + 1) / np.sqrt(k + 1) for k in range(i)
            )
        total += np.where(i <= copies, terms, 0)
    return np.maximum(total, 1e-12)


def regularizer(gaussians: Gaussians, settings: McmcSettings, extent: float) -> float:
    """Twin of `before_step`, which adds its gradient: w_o mean(o) + w_s mean(scale) / extent."""
    scales = np.exp(gaussians.log_scales).mean() / extent
    return float(
        settings.opacity_weight * _opacity(gaussians).mean() + settings.scale_weight * scales
    )
