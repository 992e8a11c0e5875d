"""What a view is told about its references: their light, warped by depth, and where they stand.

A reference's light travels as a ratio to its own photo (a fraction for a lamp that is on), because
ratios of diffuse surfaces do not depend on the view and carry no texture.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as fn
from jaxtyping import Bool, Float
from torch import Tensor

from luxcore.cameras import Camera
from luxcore.models.small.features import lamp_features
from luxcore.models.small.heads import RATIO_FLOOR, WarpedLight
from luxcore.models.small.hints import References, hints_for, moved
from luxcore.models.small.surfaces import (
    Surfaces,
    lamp_centres,
    picture_places,
    pinhole_of,
    pinhole_rays,
)

DEPTH_TOLERANCE = 0.05
"""Relative difference of depth within which two views see the same surface."""


@dataclass(frozen=True)
class TargetView:
    """A view to be decomposed, on the network's grid; masks are empty where a lamp is not seen."""

    photo: Float[Tensor, "3 h w"]
    masks: Float[Tensor, "k h w"]
    on: Bool[Tensor, " k"]
    surfaces: Surfaces | None


def multiview_features(
    target: TargetView, camera: Camera, references: References
) -> tuple[Float[Tensor, "k c h w"], WarpedLight]:
    """The MV_CHANNELS channels of every lamp (the single-view ones, warped light, Plücker rays),
    and the warped light itself."""
    k = len(target.on)
    centres = lamp_points(target, camera, references)
    hints = hints_for(target.surfaces, camera, references)
    single = lamp_features(target.photo, target.masks, target.on, target.surfaces, centres, hints)
    ratio, weight = _warped_ratio(target, camera, references)
    on = target.on.view(k, 1, 1, 1)
    fraction = ratio.clamp(0, 1.5) * on
    log_ratio = torch.log(ratio + 1e-3) / 4 * ~on * (weight > 0)
    views = references.views
    rays = pluecker(camera, views[0].camera if views else camera).expand(k, -1, -1, -1)
    warped = WarpedLight(ratio, (weight > 0).to(ratio))
    return torch.cat([single, fraction, log_ratio, warped.known, rays], dim=1), warped


def lamp_points(target: TargetView, camera: Camera, references: References) -> Float[Tensor, "k 3"]:
    """Lamp centres in the target's camera space: where references saw them, else from the target's
    own mask; not finite where nobody sees a lamp with depth."""
    points = references.centres.clone()
    if references.views:
        points = moved(points.T, references.views[0].camera, camera).T
    if target.surfaces is not None:
        own, valid = lamp_centres(target.masks, target.surfaces, target.photo, target.on)
        take = valid & ~points.isfinite().all(1)
        points[take] = own[take]
    return points


def pluecker(camera: Camera, base: Camera) -> Float[Tensor, "6 h w"]:
    """Direction and moment of every pixel's ray, in the axes and around the centre of `base`.

    Moments are squashed (x/(1+|x|)), so that a camera 1e6 m away does no harm.
    """
    to_base = torch.from_numpy(base.viewmat @ camera.c2w)
    rays = pinhole_rays(pinhole_of(camera), camera.height, camera.width).double()
    directions = torch.einsum("ij,jhw->ihw", to_base[:3, :3], rays)
    directions = directions / directions.norm(dim=0, keepdim=True)
    moment = torch.linalg.cross(
        to_base[:3, 3].view(3, 1, 1).expand_as(directions), directions, dim=0
    )
    return torch.cat([directions, moment / (1 + moment.abs())]).float()


def _warped_ratio(
    target: TargetView, camera: Camera, references: References
) -> tuple[Float[Tensor, "k 3 h w"], Float[Tensor, "k 1 h w"]]:
    """Mean over references of light/photo at the place each target pixel shows, and its weight."""
    k, h, w = target.masks.shape
    total, weight = torch.zeros(k, 3, h, w), torch.zeros(k, 1, h, w)
    surfaces = target.surfaces
    if surfaces is None or not references.light:
        return total, weight
    for reference in references.views:
        grid, visible = correspondence(surfaces, camera, reference.surfaces, reference.camera)
        ratio = reference.lights / (reference.photo + RATIO_FLOOR)
        here = fn.grid_sample(ratio, grid.expand(k, -1, -1, -1), align_corners=False)
        share = visible * reference.known.view(k, 1, 1, 1)
        total, weight = total + here * share, weight + share
    return total / weight.clamp_min(1e-6), weight


def correspondence(
    target: Surfaces, target_camera: Camera, source: Surfaces, source_camera: Camera
) -> tuple[Float[Tensor, "1 h w 2"], Float[Tensor, "h w"]]:
    """Where each target pixel's surface lies in the source picture (grid_sample coordinates), and
    a weight: 0 where the source does not see it, higher the closer the source stands."""
    place = moved(target.points.flatten(1), target_camera, source_camera)
    shape = target.points.shape[1:]
    z = place[2].clamp_min(1e-3)
    pinhole, size = pinhole_of(source_camera), (source_camera.height, source_camera.width)
    grid = picture_places(place, pinhole, *size).reshape(1, *shape, 2)
    there = fn.grid_sample(source.points[None, 2:], grid, mode="nearest", align_corners=False)[0, 0]
    z = z.reshape(shape)
    inside = (grid[0].abs() <= 1).all(-1) & (place[2].reshape(shape) > 1e-3)
    same = (there - z).abs() < DEPTH_TOLERANCE * z
    visible = inside & same & (there > 0) & (target.points[2] > 0)
    return grid, visible.float() / (0.2 + z)
