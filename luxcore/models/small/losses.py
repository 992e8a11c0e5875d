"""What the network is asked to get right: light as it is seen, at all exposures and both tasks."""

from __future__ import annotations

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from luxcore.models.small.examples import Example
from luxcore.models.small.heads import LightFields, lamp_light
from luxcore.models.small.levels import CLIPPED, PHOTO_MAX, display_curve

BRACKETS = ((1.0, 1.0), (0.25, 0.5), (0.0625, 0.25))
"""(exposure, weight): EV0, EV-2, EV-4 of the paper's three brightness levels."""

SCORE_WEIGHT = 0.1
"""Of the logarithm of the squared error, by which results are judged: an easy lamp counts as much
as a hard one."""

OFF_SCORE_WEIGHT = 0.3
OFF_WEIGHT = 0.08
"""Of the score and of the plain error of lamps that are off in the photo. The second is small:
nobody can know how bright they are. The first is not, since nothing else teaches them."""

GLOW_WEIGHT = 0.02
"""Of what the emitters themselves send, in natural logs."""

ERROR_FLOOR = 3e-4
"""Squared error below which nothing is gained: 35 dB."""


def example_loss(fields: LightFields, example: Example) -> Tensor:
    """Mean over lamps of the display-space error, for OLATs of lamps on and off; a scalar."""
    light = lamp_light(fields, example.photo, example.on)
    on = example.on
    terms = []
    if bool(on.any()):
        lit, truth = light[on], example.lights[on]
        terms.append(_seen_error(lit, truth))
        terms.append(0.5 * _one_light_off_error(fields, example))
        terms.append(0.2 * _fraction_error(fields, example))
        clipped = (example.photo.amax(0) > CLIPPED) & (example.seen.covered[on])
        terms.append(GLOW_WEIGHT * _glow_error(lit, truth, clipped))
        terms.append(SCORE_WEIGHT * _score_error(lit, truth, _not_white(truth)))
    if bool((~on).any()):
        share = float((~on).float().mean())
        lit, truth = light[~on], example.lights[~on]
        emitters = example.seen.covered[~on]
        # A shade that glows more or less than it should must not decide over the whole room.
        reflecting = _not_white(truth) & ~emitters[:, None]
        terms.append(share * OFF_SCORE_WEIGHT * _score_error(lit, truth, reflecting))
        terms.append(share * OFF_WEIGHT * _seen_error(lit, truth))
        terms.append(share * GLOW_WEIGHT * _glow_error(lit, truth, emitters))
    return torch.stack(terms).sum() if terms else fields.fraction.sum() * 0


def _seen_error(predicted: Tensor, truth: Tensor) -> Tensor:
    total = predicted.new_zeros(())
    for exposure, weight in BRACKETS:
        difference = display_curve(predicted * exposure) - display_curve(truth * exposure)
        total = total + weight * _robust(difference)
    return total


def _robust(difference: Tensor) -> Tensor:
    """Between squared (what PSNR counts) and absolute (sharp shadow edges): Charbonnier at 0.05."""
    return torch.sqrt(difference**2 + 0.05**2).sub(0.05).mean()


def _one_light_off_error(fields: LightFields, example: Example) -> Tensor:
    """The paper's second task: the photo without each burning lamp, from the same fractions."""
    fraction = fields.fraction[1:][example.on]
    visible = (example.photo.amax(0) <= CLIPPED).to(example.photo)
    rest = example.photo * (1 - fraction)
    truth = (example.photo - example.lights[example.on]).clamp_min(0)
    return _robust((display_curve(rest) - display_curve(truth)) * visible)


def _fraction_error(fields: LightFields, example: Example) -> Tensor:
    """Plain error of the fractions: dark places count as much as bright ones."""
    total = example.ambient + example.lights[example.on].sum(0) + 1e-4
    truth = torch.cat([example.ambient[None], example.lights[example.on]]) / total
    keep = torch.cat([example.on.new_ones(1), example.on])
    return (fields.fraction[keep] - truth).abs().mean()


def _glow_error(
    predicted: Float[Tensor, "k 3 h w"],
    truth: Float[Tensor, "k 3 h w"],
    emitters: Bool[Tensor, "k h w"],
) -> Tensor:
    """Mean error of what lamps themselves send, in natural logs: no bracket shows it all."""
    difference = torch.log(predicted + 1).mean(1) - torch.log(truth + 1).mean(1)
    return (difference.abs() * emitters).sum() / emitters.sum().clamp_min(1)


def _not_white(truth: Float[Tensor, "k 3 h w"]) -> Bool[Tensor, "k 1 h w"]:
    return truth.amax(1, keepdim=True) < PHOTO_MAX


def _score_error(
    predicted: Float[Tensor, "k 3 h w"],
    truth: Float[Tensor, "k 3 h w"],
    measured: Bool[Tensor, "k 1 h w"],
) -> Tensor:
    """Mean natural log of the squared error on the display curve after the best scale per lamp and
    channel: half with the scale fitted to light where it is `measured`, half to what is shown."""
    light_scale = _best_scale(predicted * measured, truth).clamp(1e-3, 1e3)
    shown, target = display_curve(predicted), display_curve(truth)
    by_light = display_curve(predicted * light_scale)
    by_picture = shown * _best_scale(shown, target)
    errors = [((picture - target) ** 2).mean((1, 2, 3)) for picture in (by_light, by_picture)]
    return torch.log(torch.stack(errors) + ERROR_FLOOR).mean()


def _best_scale(predicted: Tensor, truth: Tensor) -> Float[Tensor, "k 3 1 1"]:
    """Least squares: Σ truth·predicted / Σ predicted² of each lamp and channel."""
    squares = (predicted**2).sum((2, 3), keepdim=True).clamp_min(1e-6)
    return (predicted * truth).sum((2, 3), keepdim=True) / squares
