"""Other ways to use the same U-Net, to learn what predicting light instead of pixels is worth.

Three networks of one size, one budget and one order of photos, each from scratch:
- `fractions`: what ships, RGB fractions of the photo (and ratios for lamps that are off);
- `pixels`: the same U-Net regresses the tone-mapped OLAT;
- `flow`: it samples the tone-mapped OLAT by flow matching, in 1, 2, 4 and 8 Euler steps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from luxcore.models.small.batches import SingleBatches
from luxcore.models.small.examples import Example
from luxcore.models.small.features import SV_CHANNELS
from luxcore.models.small.fit import FitSettings, fit
from luxcore.models.small.levels import display_curve, linear_of
from luxcore.models.small.network import UNet
from luxcore.models.small.samples import CropPool
from luxcore.models.small.scores import mean_psnr, mean_psnr_of
from luxcore.models.small.training import SHAPES, start_network
from luxcore.models.small.weights import shipped_network

FLOW_STEPS = (1, 2, 4, 8)
RGB = 3
Cases = Sequence[tuple[Tensor, Example]]
Predict = Callable[[Tensor, Example], Tensor]


@dataclass(frozen=True)
class PixelBatches:
    """Batches of `source` whose example is the tone-mapped light of each lamp, -1 to 1."""

    source: SingleBatches

    def batch(self, step: int) -> list[tuple[Tensor, Tensor]]:
        """Features [k, SV_CHANNELS, h, w] and targets [k, 3, h, w] of each photo."""
        return [(f, 2 * display_curve(e.lights) - 1) for f, e in self.source.batch(step)]


@dataclass(frozen=True)
class FlowBatches:
    """As `PixelBatches`, with a point on the way from noise to the target among the features; the
    example is the velocity there. A pure function of the step."""

    source: PixelBatches

    def batch(self, step: int) -> list[tuple[Tensor, Tensor]]:
        """Features [k, SV_CHANNELS + 4, h, w] and velocities [k, 3, h, w]."""
        generator = torch.Generator().manual_seed(step)
        made = []
        for features, target in self.source.batch(step):
            noise = torch.randn(target.shape, generator=generator)
            time = torch.rand(len(target), 1, 1, 1, generator=generator)
            made.append((_flow_features(features, noise.lerp(target, time), time), target - noise))
        return made


def regression_loss(outputs: Tensor, target: Tensor) -> Tensor:
    """Charbonnier at 0.1 of a range of 2: what the shipped network's loss uses per picture."""
    return torch.sqrt((outputs - target) ** 2 + 0.01).mean()


def squared_loss(outputs: Tensor, target: Tensor) -> Tensor:
    """Flow matching needs the mean of the velocities, so the plain square."""
    return ((outputs - target) ** 2).mean()


def sample_flow(net: UNet, steps: int) -> Predict:
    """Light by `steps` Euler steps from seeded noise."""

    def predict(features: Tensor, example: Example) -> Tensor:
        shape = (len(features), RGB, *features.shape[-2:])
        x = torch.randn(shape, generator=torch.Generator().manual_seed(0))
        for number in range(steps):
            time = torch.full((len(x), 1, 1, 1), number / steps)
            x = x + net(_flow_features(features, x, time)) / steps
        return linear_of((x + 1) / 2)

    return predict


def _flow_features(
    features: Float[Tensor, "k c h w"], x: Float[Tensor, "k 3 h w"], time: Tensor
) -> Tensor:
    return torch.cat([features, x, time.expand(-1, 1, *x.shape[-2:])], dim=1)


def compare(
    pool: CropPool, cases: Cases, steps: int, photos: int, rate: float, seed: int
) -> dict[str, dict[str, float]]:
    """PSNR of lamps on and off, by variant, after `steps` steps each."""
    batches = SingleBatches(pool, seed, photos, estimator=shipped_network("geometry"))
    settings = FitSettings(steps, rate, check_every=steps)
    torch.manual_seed(seed)
    fractions = start_network("sv", None, seed)
    fit(fractions, batches, settings, lambda n: {})
    scores = {"fractions": {k: mean_psnr(fractions, cases, on=on) for k, on in _SIDES.items()}}
    pixels = UNet(replace(SHAPES["sv"], outputs=RGB))
    fit(pixels, PixelBatches(batches), settings, lambda n: {}, None, regression_loss)
    scores["pixels"] = _scores(lambda f, _: linear_of((pixels(f) + 1) / 2), cases)
    flow = UNet(replace(SHAPES["sv"], inputs=SV_CHANNELS + RGB + 1, outputs=RGB))
    fit(flow, FlowBatches(PixelBatches(batches)), settings, lambda n: {}, None, squared_loss)
    for count in FLOW_STEPS:
        scores[f"flow, {count} steps"] = _scores(sample_flow(flow, count), cases)
    return scores


_SIDES = {"lamp on": True, "lamp off": False}


def _scores(predict: Predict, cases: Cases) -> dict[str, float]:
    return {label: mean_psnr_of(predict, cases, on=on) for label, on in _SIDES.items()}
