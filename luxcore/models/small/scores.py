"""The score that training watches: the paper's metric on a few photos kept aside."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import torch
from torch import Tensor

from luxcore.light.agx import agx
from luxcore.models.small.examples import Example
from luxcore.models.small.heads import lamp_light
from luxcore.models.small.levels import PHOTO_MAX
from luxcore.models.small.network import UNet


def lamp_scores(net: UNet, cases: Sequence[tuple[Tensor, Example]]) -> dict[str, float]:
    """What the curve of a training shows: burning lamps, and lamps that are off in the photo."""
    scores = {"psnr_validation": mean_psnr(net, cases), "psnr_off": mean_psnr(net, cases, on=False)}
    return {name: value for name, value in scores.items() if math.isfinite(value)}


def mean_psnr(net: UNet, cases: Sequence[tuple[Tensor, Example]], *, on: bool = True) -> float:
    """Mean PSNR in dB of OLATs, AgX after a least-squares scale per channel, of the lamps that
    burn in the photo or of those that do not; NaN when there are none."""

    def predict(features: Tensor, example: Example) -> Tensor:
        return lamp_light(example.fields(net(features)), example.photo, example.on)

    return mean_psnr_of(predict, cases, on=on)


def mean_psnr_of(
    predict: Callable[[Tensor, Example], Tensor],
    cases: Sequence[tuple[Tensor, Example]],
    *,
    on: bool,
) -> float:
    """`mean_psnr` of anything that gives linear light [k, 3, h, w] for a photo's lamps."""
    scores: list[Tensor] = []
    with torch.no_grad():
        for features, example in cases:
            asked = example.on == on
            light = predict(features, example)[asked]
            scores += [_psnr(p, t) for p, t in zip(light, example.lights[asked], strict=True)]
    return float(torch.stack(scores).mean()) if scores else float("nan")


def _psnr(predicted: Tensor, truth: Tensor) -> Tensor:
    shown = (truth.amax(0) < PHOTO_MAX).to(truth)
    scale = (predicted * truth * shown).sum((1, 2))
    scale = scale / (predicted**2 * shown).sum((1, 2)).clamp_min(1e-9)
    shown = agx((predicted * scale[:, None, None]).movedim(0, -1))
    error = (shown - agx(truth.movedim(0, -1))) ** 2
    return -10 * torch.log10(error.mean().clamp_min(1e-8))
