"""What the network is told about one lamp of one photo, as image channels.

Directions and positions are in camera axes (OpenCV), so that turning the world changes nothing.
"""

from __future__ import annotations

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from luxcore.models.small.levels import display_curve
from luxcore.models.small.prior import Hints, first_guess, unit_irradiance
from luxcore.models.small.surfaces import Surfaces, lambert_terms, lamp_centres

SV_CHANNELS = 38
MV_CHANNELS = SV_CHANNELS + 13
LAMP_SHARE = slice(27, 30)
AMBIENT_SHARE = slice(31, 34)
LOG_RATIO = slice(35, 38)
"""Channels of the first guess: shares of light mapped to −1..1, and a lamp's light over the photo's
as natural log over LOG_RATIO_SCALE."""

LOG_RATIO_SCALE = 4.0


def lamp_features(
    photo: Float[Tensor, "3 h w"],
    masks: Float[Tensor, "k h w"],
    on: Bool[Tensor, " k"],
    surfaces: Surfaces | None,
    lamp_points: Float[Tensor, "k 3"] | None = None,
    hints: Hints | None = None,
) -> Float[Tensor, "k c h w"]:
    """The SV_CHANNELS channels of every lamp of one photo.

    `photo` is linear, at most PHOTO_MAX; `masks` are coverage in 0..1. `lamp_points` are lamp
    centres in camera space, where another view knows them (not finite: unknown); without them
    they come from the mask and the depth. `hints` is what other views tell.
    """
    k, h, w = masks.shape
    centres, known = _centres(photo, masks, on, surfaces, lamp_points)
    irradiance = unit_irradiance(masks, surfaces, centres, known)
    guess = first_guess(photo, masks, irradiance.total, on, hints)
    shared = photo_features(photo)
    others_on, others_off = _other_masks(masks, on)
    channels = [
        shared.expand(k, -1, -1, -1),
        masks[:, None],
        others_on[:, None],
        others_off[:, None],
        _mask_relative(masks),
        _relative_colour(photo, masks),
        on.to(photo).view(k, 1, 1, 1).expand(k, 1, h, w),
        _geometry(masks, surfaces, centres, known),
        2 * guess.lamps - 1,
        torch.log2(irradiance.total[:, None] + 1e-3) / 4,
        2 * guess.ambient.expand(k, -1, -1, -1) - 1,
        irradiance.visible[:, None],
        guess.log_ratio / LOG_RATIO_SCALE,
    ]
    return torch.cat(channels, dim=1)


def photo_features(photo: Float[Tensor, "3 h w"]) -> Float[Tensor, "6 h w"]:
    """The photo on the display curve and in stops, both about zero."""
    return torch.cat([display_curve(photo) - 0.5, _stops(photo) / 4])


def _stops(linear: Tensor) -> Tensor:
    """Log2 relative to mid-grey; 1e-3 keeps black finite at −7.5 stops."""
    return torch.log2((linear + 1e-3) / 0.18)


def _other_masks(masks: Tensor, on: Tensor) -> tuple[Tensor, Tensor]:
    burning, dark = masks * on.view(-1, 1, 1), masks * ~on.view(-1, 1, 1)
    return (
        (burning.sum(0) - burning).clamp(0, 1),
        (dark.sum(0) - dark).clamp(0, 1),
    )


def _mask_relative(masks: Tensor) -> Tensor:
    """[k 3 h w]: x and y from the mask's centroid and closeness to it, per long side."""
    k, h, w = masks.shape
    y, x = torch.meshgrid(torch.arange(h) + 0.5, torch.arange(w) + 0.5, indexing="ij")
    grid = torch.stack([x, y]).to(masks) / max(h, w)
    total = masks.sum((1, 2)).clamp_min(1e-6)
    centroid = torch.einsum("khw,chw->kc", masks, grid) / total[:, None]
    offset = grid - centroid.view(k, 2, 1, 1)
    closeness = torch.exp(-4 * offset.norm(dim=1, keepdim=True))
    seen = (masks.sum((1, 2)) > 0).view(k, 1, 1, 1)
    return torch.cat([offset * 2, closeness], dim=1) * seen


def _relative_colour(photo: Tensor, masks: Tensor) -> Tensor:
    """[k 3 h w]: stops of each pixel above the lamp's own mean colour."""
    stops = _stops(photo)
    total = masks.sum((1, 2)).clamp_min(1e-6)
    lamp = torch.einsum("khw,chw->kc", masks, stops) / total[:, None]
    seen = (masks.sum((1, 2)) > 0).view(-1, 1, 1, 1)
    return (stops - lamp.view(-1, 3, 1, 1)) / 8 * seen


def _centres(
    photo: Tensor,
    masks: Tensor,
    on: Tensor,
    surfaces: Surfaces | None,
    lamp_points: Tensor | None,
) -> tuple[Tensor | None, Tensor | None]:
    """Lamp centres in camera space and which of them are known; None without geometry."""
    if surfaces is None:
        return None, None
    if lamp_points is None:
        return lamp_centres(masks, surfaces, photo, on)
    return lamp_points, lamp_points.isfinite().all(1)


def _geometry(
    masks: Tensor, surfaces: Surfaces | None, centres: Tensor | None, known: Tensor | None
) -> Tensor:
    """[k 11 h w]: normal, inverse depth, direction to lamp, distance, cosine term, whether the
    lamp's place is known, trust in all of it."""
    k, h, w = masks.shape
    if surfaces is None or centres is None or known is None or not k:
        return masks.new_zeros(k, 11, h, w)
    return torch.stack([_one_geometry(surfaces, centres[i], bool(known[i])) for i in range(k)])


def _one_geometry(surfaces: Surfaces, centre: Tensor, lamp_known: bool) -> Tensor:
    valid = surfaces.valid.to(surfaces.points)
    inverse_depth = valid / surfaces.points[2].clamp_min(0.1)
    seen = torch.cat([surfaces.normals, inverse_depth[None]])
    if not lamp_known:
        lamp = torch.zeros_like(surfaces.points[:1]).expand(6, -1, -1)
    else:
        direction, distance, irradiance = lambert_terms(surfaces, centre)
        scalars = [torch.log2(distance) / 2, torch.log2(irradiance + 1e-3) / 4]
        lamp = torch.cat([direction, torch.stack(scalars), torch.ones_like(valid)[None]])
    return torch.cat([seen, lamp, torch.full_like(valid, surfaces.trust)[None]]) * valid
