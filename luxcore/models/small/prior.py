"""A first guess at each lamp's share of the photo: irradiance with fitted lamp powers.

If all surfaces were of one colour, the photo would be Σ_i s_i · E_i + a, where E_i is the
irradiance of lamp i at unit power: Lambert's law, the shadows that the depth map shows, and what
bounces. The powers s and the ambient a that fit the photo best are a small non-negative
least-squares problem; what each term explains is the guess. It tells the network, which sees one
lamp at a time, how the lamps compare.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from luxcore.models.small.levels import CLIPPED
from luxcore.models.small.surfaces import Surfaces, lambert_terms
from luxcore.models.small.transport import bounce_of, visibility

FALLOFF = 0.15
"""Without geometry light falls off in the picture: to one half at this share of the long side."""

FITTED_WEIGHT = 0.5
"""Exponent of shares whose powers were fitted to the photo alone: halving the logits was best on
rooms that neither fit nor network had seen (docs/models.md)."""

SHARE_FLOOR = 0.02
"""Added to shares and ratios: a guess of exactly nothing would tell the network too much."""

ALTERNATIONS = 5
LEAST_POWER = 1e-6

MAX_FIT_PIXELS = 1500
RELATIVE_FLOOR = 0.02
"""As in the scale-factor solver: errors count relative to pixel + 0.02."""

REWEIGHTINGS = 6
ORDINARY_LOG = 0.5
"""Surfaces differ from the one colour by this natural log; what differs by more counts less."""

LOG_FLOOR = 2e-3

MOST_IRRADIANCE = 4.0
"""Of direct light, at unit power in 1/m²: nearer than half a metre no lamp is a point."""


@dataclass(frozen=True)
class Irradiance:
    """What lamps of unit power would send to each surface, in 1/m²; `visible` is the share of the
    lamp that a surface sees, 1 where nothing is known."""

    total: Float[Tensor, "k h w"]
    visible: Float[Tensor, "k h w"]


def unit_irradiance(
    masks: Float[Tensor, "k h w"],
    surfaces: Surfaces | None,
    centres: Float[Tensor, "k 3"] | None,
    known: Bool[Tensor, " k"] | None,
) -> Irradiance:
    """cos/d² where the lamp is seen and what bounces, for lamps whose place is known, else a
    falloff around the mask; 0 for a lamp with neither. A lamp's own mask glows: ten times its
    largest value."""
    totals, seen = [], []
    placed = torch.zeros(len(masks), dtype=torch.bool) if known is None else known
    bounce = bounce_of(surfaces) if surfaces is not None and bool(placed.any()) else None
    for index, mask in enumerate(masks):
        visible = torch.ones_like(mask)
        if surfaces is None or centres is None or bounce is None or not placed[index]:
            field = _falloff(mask)
        else:
            visible = visibility(surfaces, centres[index], mask)
            direct = lambert_terms(surfaces, centres[index])[2].clamp_max(MOST_IRRADIANCE) * visible
            field = direct + bounce.irradiance(direct)
        totals.append(torch.where(mask > 0.5, 10 * field.amax().clamp_min(1e-3), field))
        seen.append(visible)
    if not totals:
        return Irradiance(masks, masks)
    return Irradiance(torch.stack(totals), torch.stack(seen))


@dataclass(frozen=True)
class Powers:
    """RGB powers of lamps and of the ambient, in one unknown unit; `known` says of which lamps."""

    lamps: Float[Tensor, "k 3"]
    ambient: Float[Tensor, " 3"]
    known: Bool[Tensor, " k"]


@dataclass(frozen=True)
class Hints:
    """What other views tell: powers, and natural logs by which to correct the shares of the lamps
    and, last, of the ambient, and every lamp's ratio; None corrects nothing."""

    powers: Powers
    log_shares: Float[Tensor, "k1 3 h w"] | None = None
    log_ratio: Float[Tensor, "k 3 h w"] | None = None


@dataclass(frozen=True)
class FirstGuess:
    """Shares (0..1) of each pixel and channel that the burning lamps (0 when off) and the ambient
    have, and for every lamp the natural log of its light over the photo."""

    lamps: Float[Tensor, "k 3 h w"]
    ambient: Float[Tensor, "3 h w"]
    log_ratio: Float[Tensor, "k 3 h w"]


def first_guess(
    photo: Float[Tensor, "3 h w"],
    masks: Float[Tensor, "k h w"],
    irradiance: Float[Tensor, "k h w"],
    on: Bool[Tensor, " k"],
    hints: Hints | None = None,
) -> FirstGuess:
    """What each lamp sends by its irradiance and power, over what all of them send.

    Powers that `hints` bring are taken as they are, and others fitted beside them. Powers fitted to
    the photo alone are doubtful: their shares count at half their weight.
    """
    if not len(on):
        nothing = photo.new_zeros(0, *photo.shape)
        return FirstGuess(nothing, torch.ones_like(photo), nothing)
    means = irradiance.clamp_max(MOST_IRRADIANCE).flatten(1).mean(1).clamp_min(1e-6)
    field = irradiance / means[:, None, None]
    powers = None
    if hints is not None:
        powers = replace(hints.powers, lamps=hints.powers.lamps * means[:, None])
    strengths, ambient = _strengths(photo, field, reflecting(photo, masks), on, powers)
    burning = field[:, None] * (strengths * on[:, None])[:, :, None, None]
    level = ambient.view(1, 3, 1, 1).expand_as(burning[:1])
    sent = (burning.sum(0) + level[0]).clamp_min(1e-9)
    # Nobody can know how strong an unlit lamp is: as strong in the mean as all that burns.
    told = on if powers is None else on | powers.known
    strengths = torch.where(told[:, None], strengths, sent.mean((1, 2)))
    log_ratio = torch.log(field[:, None] * strengths[:, :, None, None] / sent + SHARE_FLOOR)
    return _corrected(torch.cat([burning, level]) / sent + SHARE_FLOOR, log_ratio, on, hints)


def _corrected(
    shares: Float[Tensor, "k1 3 h w"],
    log_ratio: Float[Tensor, "k 3 h w"],
    on: Bool[Tensor, " k"],
    hints: Hints | None,
) -> FirstGuess:
    """Shares of lamps and, last, of the ambient that sum to 1, as far as hints or doubt go."""
    if hints is None:
        shares = shares**FITTED_WEIGHT
    elif hints.log_shares is not None and hints.log_ratio is not None:
        shares, log_ratio = shares * hints.log_shares.exp(), log_ratio + hints.log_ratio
    shares = shares * torch.cat([on, on.new_ones(1)]).view(-1, 1, 1, 1)
    shares = shares / shares.sum(0)
    return FirstGuess(shares[:-1], shares[-1], log_ratio)


def reflecting(photo: Float[Tensor, "3 h w"], masks: Float[Tensor, "k h w"]) -> Bool[Tensor, "h w"]:
    """Where the photo tells how bright a surface is that does not glow itself."""
    return (photo.amax(0) < CLIPPED) & (masks.amax(0) < 0.1)


def _strengths(
    photo: Tensor, field: Tensor, usable: Tensor, on: Tensor, powers: Powers | None
) -> tuple[Float[Tensor, "k 3"], Float[Tensor, " 3"]]:
    """Powers of the lamps for `field`, and of the ambient: known ones as they are, the other
    burning ones fitted beside them; 0 for the rest."""
    known = torch.zeros_like(on) if powers is None else powers.known
    strengths = field.new_zeros(len(on), 3) if powers is None else powers.lamps * known[:, None]
    ambient = field.new_ones(3) if powers is None else powers.ambient
    wanted = torch.nonzero(on & ~known)[:, 0]
    if powers is not None and not len(wanted):
        return strengths, ambient
    for channel in range(3):
        lit = (strengths[:, channel] * on).view(-1, 1, 1) * field
        rest = lit.sum(0) + ambient[channel]
        basis = torch.cat([field[wanted], rest[None]])
        fitted = _fit(photo[channel], basis, usable)
        if powers is None:
            strengths[wanted, channel], ambient[channel] = fitted[:-1], fitted[-1]
        else:
            strengths[wanted, channel] = fitted[:-1] / fitted[-1].clamp_min(LEAST_POWER)
    return strengths, ambient


def powers_seen(
    photo: Float[Tensor, "3 h w"],
    lights: Float[Tensor, "k 3 h w"],
    irradiance: Float[Tensor, "k h w"],
    on: Bool[Tensor, " k"],
    known: Bool[Tensor, " k"],
    usable: Bool[Tensor, "h w"],
) -> Powers:
    """The powers that explain a view whose `lights` are known, by alternating least squares: given
    powers, the photo tells each surface's colour; given colours, each light tells its power."""
    burning = on & known
    ambient = (photo - lights[burning].sum(0)).clamp_min(0)
    seen = torch.cat([lights, ambient[None]])[:, :, usable]
    field = torch.cat([irradiance, torch.ones_like(irradiance[:1])])[:, None, usable]
    plain = photo[:, usable]
    weight = 1 / (plain + RELATIVE_FLOOR)
    counted = torch.cat([burning, on.new_ones(1)]).view(-1, 1, 1)
    powers = (seen * weight).sum(2) / (field * weight).sum(2).clamp_min(1e-9)
    for _ in range(ALTERNATIONS):
        sent = (powers[:, :, None] * field * counted).sum(0)
        basis = field * plain / sent.clamp_min(1e-9) * weight
        powers = (seen * weight * basis).sum(2) / (basis**2).sum(2).clamp_min(1e-9)
    # A little of everything stays, as in the fit, also in a channel that the photo lacks.
    strongest = powers.amax(0).clamp_min(1e3 * LEAST_POWER)
    powers = torch.maximum(powers, 1e-3 * strongest)
    return Powers(powers[:-1], powers[-1], known)


def _fit(
    plane: Float[Tensor, "h w"], basis: Float[Tensor, "b h w"], usable: Bool[Tensor, "h w"]
) -> Float[Tensor, " b"]:
    """Non-negative least squares of relative errors, reweighted so that surfaces far darker or
    brighter than the fit (another paint, light that no lamp explains) count less."""
    from scipy.optimize import nnls

    values, columns = plane[usable].numpy(), basis[:, usable].numpy().T
    step = max(1, len(values) // MAX_FIT_PIXELS)
    values, columns = values[::step].astype(np.float64), columns[::step].astype(np.float64)
    if len(values) < columns.shape[1]:
        return torch.ones(len(basis))
    # A little of everything stays: a share of exactly zero would tell the network too much.
    least = 1e-3 * values.mean()
    weight = 1 / (values + RELATIVE_FLOOR)
    for _ in range(REWEIGHTINGS):
        powers = nnls(columns * weight[:, None], values * weight)[0] + least
        fitted = columns @ powers
        logs = np.log(values + LOG_FLOOR) - np.log(fitted + LOG_FLOOR)
        weight = 1 / ((fitted + RELATIVE_FLOOR) * np.hypot(1, logs / ORDINARY_LOG))
    return torch.from_numpy(powers).float()


def _falloff(mask: Tensor) -> Tensor:
    total = float(mask.sum())
    if total <= 0:
        return torch.zeros_like(mask)
    h, w = mask.shape
    y, x = torch.meshgrid(torch.arange(h).float(), torch.arange(w).float(), indexing="ij")
    centre_y, centre_x = (mask * y).sum() / total, (mask * x).sum() / total
    squared = ((y - centre_y) ** 2 + (x - centre_x) ** 2) / (FALLOFF * max(h, w)) ** 2
    return 1 / (1 + squared)
