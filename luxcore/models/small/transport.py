"""How light gets about on the surfaces that a photo shows: shadows, and what bounces.

Both are read off the depth map, so they know nothing of what lies outside the picture or behind
the first surface: a first guess for the network, which learns what is wrong with it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
import torch.nn.functional as fn
from jaxtyping import Float
from torch import Tensor

from luxcore.models.small.surfaces import Surfaces, picture_places, pinhole_rays

RAY_STEPS = 16
"""Places on the way from a surface to the lamp where the depth map is asked."""

SHADOW_BIAS_M = 0.05
SHADOW_SLOPE = 0.02
"""A surface blocks a ray that passes this far behind it, the second per metre of depth."""

THICKNESS_M = 0.8
"""What passes further behind a surface than this is taken to pass behind the thing itself."""

FIXTURE_M = 0.15
"""Nothing this near to the lamp's centre blocks it: that is the fixture."""

CELLS = 12
"""Light bounces between this many patches a side."""

RECEIVERS = 48
"""Bounced light is smooth: it is gathered on at most this many places a side, then enlarged."""

REFLECTANCE = 0.7
BEYOND = 0.1
"""Share of the mean irradiance that comes back from surfaces outside the picture."""

FARTHEST_M = 30.0
"""What is farther away is seen through a window and sends no lamp's light back."""

TINY_M2 = 1e-4


def visibility(
    surfaces: Surfaces, centre: Float[Tensor, " 3"], mask: Float[Tensor, "h w"]
) -> Float[Tensor, "h w"]:
    """Share (0..1) of a lamp at `centre` that each surface sees past the others.

    `mask` covers the lamp's own fixture, which casts no shadow here.
    """
    points = surfaces.points
    offset = centre.view(3, 1, 1) - points
    along = (torch.arange(RAY_STEPS) + 0.5) / RAY_STEPS
    rays = points[None] + along.view(-1, 1, 1, 1) * offset[None]
    depth = torch.where(mask > 0.2, torch.zeros_like(mask), points[2])
    there = _depth_at(surfaces, rays, depth)
    behind = rays[:, 2] - there - SHADOW_SLOPE * rays[:, 2]
    near_lamp = (1 - along).view(-1, 1, 1) * offset.norm(dim=0)[None] < FIXTURE_M
    hits = (behind < THICKNESS_M) & (there > 0) & (rays[:, 2] > SHADOW_BIAS_M) & ~near_lamp
    blocked = torch.sigmoid(2 * (behind - SHADOW_BIAS_M) / SHADOW_BIAS_M) * hits
    seen = (1 - blocked).prod(0)[None, None]
    return fn.avg_pool2d(seen, 3, stride=1, padding=1, count_include_pad=False)[0, 0]


def _depth_at(
    surfaces: Surfaces, places: Float[Tensor, "n 3 h w"], depth: Float[Tensor, "h w"]
) -> Float[Tensor, "n h w"]:
    """The depth map where each place would be seen; 0 outside the picture."""
    grid = picture_places(places.movedim(1, 0), surfaces.pinhole, *depth.shape).clamp(-4, 4)
    source = depth.expand(len(places), 1, *depth.shape)
    return fn.grid_sample(source, grid, mode="nearest", align_corners=False)[:, 0]


@dataclass(frozen=True)
class Bounce:
    """Form factors of one photo: `gather` to every receiver and `exchange` among patches."""

    gather: Float[Tensor, "r p"]
    exchange: Float[Tensor, "p p"]
    weight: Float[Tensor, "h w"]
    """Surface that each pixel shows, square metres."""

    receivers: tuple[int, int]

    def irradiance(self, direct: Float[Tensor, "h w"]) -> Float[Tensor, "h w"]:
        """What direct irradiance becomes after one and two bounces on surfaces of one grey."""
        total = _cells(self.weight)
        patches = _cells(direct * self.weight) / total.clamp_min(TINY_M2)
        once = REFLECTANCE * patches
        sent = once + REFLECTANCE * (self.exchange @ once)
        arrived = (self.gather @ sent).view(1, 1, *self.receivers)
        size = direct.shape
        if self.receivers != tuple(size):
            arrived = fn.interpolate(arrived, tuple(size), mode="bilinear", align_corners=False)
        return arrived[0, 0] + BEYOND * direct.mean()


def bounce_of(surfaces: Surfaces) -> Bounce:
    """The form factors of a photo's surfaces (disc to point), without what stands between them."""
    near = surfaces.valid & (surfaces.points[2] < FARTHEST_M)
    points = torch.where(near, surfaces.points, torch.zeros_like(surfaces.points))
    fx, fy, _, _ = surfaces.pinhole
    rays = pinhole_rays(surfaces.pinhole, *points.shape[1:])
    facing = (surfaces.normals * rays).sum(0).abs().clamp_min(0.1)
    weight = near * points[2] ** 2 / (fx * fy * facing)
    area = _cells(weight)
    middle = torch.stack([_cells(axis * weight) for axis in points]) / area.clamp_min(TINY_M2)
    normal = torch.stack([_cells(axis * weight) for axis in surfaces.normals])
    normal = normal / normal.norm(dim=0).clamp_min(1e-6)
    step = max(1, math.ceil(max(weight.shape) / RECEIVERS))
    shown = [every(field, step) for field in (points, surfaces.normals)]
    area = area * (weight.numel() / CELLS**2)
    gather = _form_factors(shown[0].flatten(1), shown[1].flatten(1), middle, normal, area)
    exchange = _form_factors(middle, normal, middle, normal, area)
    return Bounce(gather, exchange, weight, (shown[0].shape[1], shown[0].shape[2]))


def every(field: Float[Tensor, "c h w"], step: int) -> Float[Tensor, "c y x"]:
    """Every `step`-th pixel both ways, from the middle of the first step on."""
    return field[:, step // 2 :: step, step // 2 :: step]


def _cells(field: Float[Tensor, "h w"]) -> Float[Tensor, " p"]:
    return fn.adaptive_avg_pool2d(field[None, None], CELLS).flatten()


def _form_factors(
    points: Float[Tensor, "3 r"],
    normals: Float[Tensor, "3 r"],
    middle: Float[Tensor, "3 p"],
    facing: Float[Tensor, "3 p"],
    area: Float[Tensor, " p"],
) -> Float[Tensor, "r p"]:
    """cos·cos·A/(πd² + A): the share of a patch's radiosity that arrives at each point."""
    squared = ((points**2).sum(0)[:, None] + (middle**2).sum(0) - 2 * points.T @ middle).clamp_min(
        1e-6
    )
    # Both cosines times the distance: (middle - point)·normal, and (point - middle)·facing.
    arriving = (normals.T @ middle - (normals * points).sum(0)[:, None]).clamp_min(0)
    leaving = (points.T @ facing - (middle * facing).sum(0)).clamp_min(0)
    return arriving * leaving * area / (squared * (math.pi * squared + area + TINY_M2))
