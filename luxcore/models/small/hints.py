"""What references with known light tell about a view beyond the places that both see.

They tell how strong each lamp is, which a photo alone can only guess, and by how much the first
guess is wrong on their own surfaces; that correction is carried to surfaces near by that face the
same way.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as fn
from jaxtyping import Bool, Float
from torch import Tensor

from luxcore.cameras import Camera
from luxcore.models.small.prior import (
    SHARE_FLOOR,
    FirstGuess,
    Hints,
    Powers,
    first_guess,
    powers_seen,
    reflecting,
    unit_irradiance,
)
from luxcore.models.small.surfaces import Surfaces, lamp_centres
from luxcore.models.small.transport import every

PLACES = 24
"""Corrections are carried between at most this many places a side."""

REACH_M = 0.25
"""Distance at which a correction counts a quarter of what it counts on the spot."""

MOST_CORRECTION = 4.0
MOST_DIFFERENCE = 20.0
FEWEST_PIXELS = 40
"""A reference that shows less than this of unclipped surfaces tells nothing."""


@dataclass(frozen=True)
class KnownLight:
    """A reference on the network's grid. `known[k]`: lamp k's light is given here."""

    camera: Camera
    photo: Float[Tensor, "3 h w"]
    masks: Float[Tensor, "k h w"]
    on: Bool[Tensor, " k"]
    surfaces: Surfaces
    lights: Float[Tensor, "k 3 h w"]
    known: Bool[Tensor, " k"]


@dataclass(frozen=True)
class Calibration:
    """What a reference tells: powers, and by how much the first guess with them is wrong (see
    `_corrections`) on its `usable` surfaces."""

    view: KnownLight
    usable: Bool[Tensor, "h w"]
    powers: Powers
    corrections: Float[Tensor, "n 3 h w"]


@dataclass(frozen=True)
class References:
    """The references of a pass. `centres` are of lamps, in the first one's camera space, metres;
    not finite for lamps that none of them shows with depth. Without `light` only these places are
    told: an ablation."""

    views: tuple[KnownLight, ...]
    centres: Float[Tensor, "k 3"]
    calibrations: tuple[Calibration, ...]
    light: bool


def references_of(views: Sequence[KnownLight], lamps: int, *, light: bool = True) -> References:
    """All that does not depend on the view that is asked about."""
    centres = torch.full((lamps, 3), float("nan"))
    for view in views:
        seen, valid = lamp_centres(view.masks, view.surfaces, view.photo, view.on)
        here = moved(seen.T, view.camera, views[0].camera).T
        take = valid & ~centres.isfinite().all(1)
        centres[take] = here[take]
    calibrations = [
        _calibration(view, views[0].camera, centres) for view in views if light and lamps
    ]
    told = tuple(found for found in calibrations if found is not None)
    return References(tuple(views), centres, told, light)


def _calibration(
    view: KnownLight, first: Camera, centres: Float[Tensor, "k 3"]
) -> Calibration | None:
    usable = reflecting(view.photo, view.masks) & view.surfaces.valid
    if int(usable.sum()) < FEWEST_PIXELS:
        return None
    points = moved(centres.T, first, view.camera).T
    field = unit_irradiance(view.masks, view.surfaces, points, points.isfinite().all(1)).total
    powers = powers_seen(view.photo, view.lights, field, view.on, view.known, usable)
    guess = first_guess(view.photo, view.masks, field, view.on, Hints(powers))
    return Calibration(view, usable, powers, _corrections(view, guess))


def hints_for(surfaces: Surfaces | None, camera: Camera, references: References) -> Hints | None:
    """Powers and corrections for a view with these `surfaces`; None where nothing can be told."""
    if surfaces is None or not references.calibrations:
        return None
    lamps = len(references.centres)
    powers = references.calibrations[0].powers
    for calibration in references.calibrations[1:]:
        powers = _joined(powers, calibration.powers)
    height, width = surfaces.points.shape[1:]
    weighted, weight = torch.zeros(2 * lamps + 1, 3, height, width), torch.zeros(height, width)
    for calibration in references.calibrations:
        carried, share = _carried(calibration, surfaces, camera)
        weighted, weight = weighted + carried, weight + share
    correction = weighted / (weight + 1e-2)
    shares, log_ratio = correction[: lamps + 1], correction[lamps + 1 :]
    return Hints(powers, shares, log_ratio * powers.known.view(-1, 1, 1, 1))


def moved(points: Float[Tensor, "3 n"], source: Camera, target: Camera) -> Float[Tensor, "3 n"]:
    """Points from one camera's space to another's."""
    change = torch.from_numpy(target.viewmat @ source.c2w)
    return (change[:3, :3] @ points.double() + change[:3, 3:]).float()


def _joined(first: Powers, second: Powers) -> Powers:
    """Powers of the first, and those that only the second knows, by their ambient's measure."""
    # Two views of one room: their paint differs, their ambient light not by more than this.
    measure = (first.ambient / second.ambient).clamp(1 / MOST_DIFFERENCE, MOST_DIFFERENCE)
    only = second.known & ~first.known
    lamps = torch.where(only[:, None], second.lamps * measure, first.lamps)
    return Powers(lamps, first.ambient, first.known | second.known)


def _corrections(view: KnownLight, guess: FirstGuess) -> Float[Tensor, "n 3 h w"]:
    """Natural logs of the true over the guessed shares of lamps and ambient, then of the ratios;
    0 for what the view does not know."""
    burning = (view.on & view.known).view(-1, 1, 1, 1)
    lit = view.lights * burning
    rest = (view.photo - lit.sum(0)).clamp_min(0)
    photo = view.photo + 1e-4
    shares = torch.log((lit / photo).clamp(0, 1) + SHARE_FLOOR) - torch.log(
        guess.lamps + SHARE_FLOOR
    )
    ambient = torch.log((rest / photo).clamp(0, 1) + SHARE_FLOOR) - torch.log(
        guess.ambient + SHARE_FLOOR
    )
    ratios = torch.log(view.lights / photo + SHARE_FLOOR) - guess.log_ratio
    known = view.known.view(-1, 1, 1, 1)
    stacked = torch.cat([shares * burning, ambient[None], ratios * known])
    return stacked.clamp(-MOST_CORRECTION, MOST_CORRECTION)


def _carried(
    calibration: Calibration, surfaces: Surfaces, camera: Camera
) -> tuple[Float[Tensor, "n 3 y x"], Float[Tensor, "y x"]]:
    """Sums of a reference's corrections weighted by nearness and facing, and of the weights."""
    view, usable, corrections = calibration.view, calibration.usable, calibration.corrections
    height, width = surfaces.points.shape[1:]
    step = max(1, math.ceil(max(height, width) / PLACES))
    here = every(surfaces.points, step)
    facing = every(surfaces.normals, step)
    rows, columns = here.shape[1:]
    there = moved(here.flatten(1), camera, view.camera)
    turned = moved(facing.flatten(1), camera, view.camera) - moved(
        torch.zeros(3, 1), camera, view.camera
    )
    source = max(1, math.ceil(max(usable.shape) / PLACES))
    taken = every(usable[None].float(), source).bool()[0].flatten()
    points = every(view.surfaces.points, source).flatten(1)[:, taken]
    normals = every(view.surfaces.normals, source).flatten(1)[:, taken]
    values = every(corrections.flatten(0, 1), source).flatten(1)[:, taken]
    near = (1 + torch.cdist(there.T, points.T) ** 2 / REACH_M**2) ** -2
    kernel = near * (turned.T @ normals).clamp_min(0) ** 2
    sums = torch.cat([values @ kernel.T, kernel.sum(1)[None]]).view(1, -1, rows, columns)
    sums = fn.interpolate(sums, (height, width), mode="bilinear", align_corners=False)[0]
    return sums[:-1].view(len(corrections), 3, height, width), sums[-1]
