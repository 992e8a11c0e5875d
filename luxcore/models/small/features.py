"""What the network is told about one lamp of one photo, as image channels.

Directions and positions are in camera axes (OpenCV), so that turning the world changes nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

PHOTO_MAX = 16.3
"""Largest linear value that an 8-bit AgX picture at EV0 can carry (docs/models.md)."""

CLIPPED = 0.9 * PHOTO_MAX
"""A pixel whose brightest channel exceeds this is clipped: its true value is unknown."""

SV_CHANNELS = 27
MV_CHANNELS = SV_CHANNELS + 13


@dataclass(frozen=True)
class Surfaces:
    """Geometry of one photo on the network's grid; zeros where unknown.

    `points` are camera-space positions in metres, `normals` unit vectors in camera axes.
    """

    points: Float[Tensor, "3 h w"]
    normals: Float[Tensor, "3 h w"]

    @property
    def valid(self) -> Bool[Tensor, "h w"]:
        """Where the surface is known."""
        return (self.points[2] > 0) & (self.normals.abs().sum(0) > 0)


def display_curve(linear: Tensor) -> Tensor:
    """Linear light to 0..1 as the eye and AgX see it: x^a/(x^a + m^a), smooth and monotone.

    A stand-in for AgX inside features and losses: mid-grey 0.18 lands at 0.48, 16 at 0.98, and the
    gradient never dies. Reported metrics use AgX itself.
    """
    response = (linear.clamp_min(0) / 0.2 + 1e-6) ** 0.85
    return response / (1 + response)


def lamp_features(
    photo: Float[Tensor, "3 h w"],
    masks: Float[Tensor, "k h w"],
    on: Bool[Tensor, " k"],
    surfaces: Surfaces | None,
    lamp_points: Float[Tensor, "k 3"] | None = None,
) -> Float[Tensor, "k c h w"]:
    """The SV_CHANNELS channels of every lamp of one photo.

    `photo` is linear, at most PHOTO_MAX; `masks` are coverage in 0..1. `lamp_points` are lamp
    centres in camera space, where another view knows them (not finite: unknown); without them
    they come from the mask and the depth.
    """
    k, h, w = masks.shape
    shared = torch.cat([display_curve(photo) - 0.5, _stops(photo) / 4])
    others_on, others_off = _other_masks(masks, on)
    channels = [
        shared.expand(k, -1, -1, -1),
        masks[:, None],
        others_on[:, None],
        others_off[:, None],
        _mask_relative(masks),
        _relative_colour(photo, masks),
        on.to(photo).view(k, 1, 1, 1).expand(k, 1, h, w),
        _geometry(masks, surfaces, lamp_points),
    ]
    return torch.cat(channels, dim=1)


def lamp_centres(
    masks: Float[Tensor, "k h w"], surfaces: Surfaces
) -> tuple[Float[Tensor, "k 3"], Bool[Tensor, " k"]]:
    """Camera-space centre of what each mask covers, metres, and whether any of it has depth."""
    weight = masks * (surfaces.points[2] > 0)
    total = weight.sum((1, 2))
    centres = torch.einsum("khw,chw->kc", weight, surfaces.points) / total.clamp_min(1e-6)[:, None]
    return centres, total > 0


def lambert_terms(
    surfaces: Surfaces, centre: Float[Tensor, " 3"]
) -> tuple[Float[Tensor, "3 h w"], Float[Tensor, "h w"], Float[Tensor, "h w"]]:
    """Unit direction to the lamp, distance in metres, and cos/d² for a lamp at `centre`."""
    offset = centre.view(3, 1, 1) - surfaces.points
    distance = offset.norm(dim=0).clamp_min(0.05)
    direction = offset / distance
    cosine = (direction * surfaces.normals).sum(0).clamp_min(0)
    return direction, distance, cosine / distance**2


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


def _geometry(
    masks: Tensor, surfaces: Surfaces | None, lamp_points: Float[Tensor, "k 3"] | None
) -> Tensor:
    """[k 11 h w]: normal, inverse depth, direction to lamp, distance, cosine term, flags."""
    k, h, w = masks.shape
    if surfaces is None:
        return masks.new_zeros(k, 11, h, w)
    if lamp_points is None:
        centres, known = lamp_centres(masks, surfaces)
    else:
        centres, known = lamp_points, lamp_points.isfinite().all(1)
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
    return torch.cat([seen, lamp, torch.ones_like(valid)[None]]) * valid
