"""A photo of any size on the network's grid, and the network's light fields back at full size."""

from __future__ import annotations

import numpy as np
import torch
import torch.nn.functional as fn
from jaxtyping import Bool, Float
from torch import Tensor

from luxcore.models.interface import Geometry
from luxcore.models.small.heads import (
    LightFields,
    OnGrid,
    burning_light,
    lamp_light,
    unlit_light,
)
from luxcore.models.small.levels import CLIPPED, PHOTO_MAX
from luxcore.models.small.samples import chw
from luxcore.models.small.surfaces import Surfaces, surfaces_of

GUIDE_RADIUS = 2
GUIDE_SMOOTHNESS = 0.05
"""Variance of the guide (in stops/4, squared) below which a patch counts as flat."""

FILL_RADIUS = 4
"""Two guided windows inside a mask nothing is told any more of what lies around it."""

EDGE_COVERAGE = 0.25
"""From this share of a mask on a place of the grid tells nothing of what lies around the lamp."""


def grid_size(height: int, width: int, long_side: int, stride: int) -> tuple[int, int]:
    """(height, width) for the network: the long side near `long_side`, multiples of `stride`."""
    scale = long_side / max(height, width)
    return (
        max(stride, round(height * scale / stride) * stride),
        max(stride, round(width * scale / stride) * stride),
    )


def to_grid(image: Float[Tensor, "c h w"], size: tuple[int, int]) -> Float[Tensor, "c y x"]:
    """Area averages where the picture shrinks, interpolation where it grows."""
    height, width = image.shape[-2:]
    if size[0] <= height and size[1] <= width:
        return fn.interpolate(image[None], size, mode="area")[0]
    return fn.interpolate(image[None], size, mode="bilinear", align_corners=False)[0]


def photo_to_grid(
    image_linear: Float[np.ndarray, "h w 3"], size: tuple[int, int]
) -> Float[Tensor, "3 y x"]:
    """The photo as the network sees it: averaged in linear light, clipped at the photo's white."""
    return to_grid(chw(image_linear), size).clamp(0, PHOTO_MAX)


def masks_to_grid(
    masks: Bool[np.ndarray, "k h w"], size: tuple[int, int]
) -> Float[Tensor, "k y x"]:
    """Coverage 0..1. A lamp too small for the grid keeps a pixel of coverage above one half."""
    if not len(masks):
        return torch.zeros(0, *size)
    coverage = to_grid(torch.from_numpy(masks.astype(np.float32)), size)
    peak = coverage.amax((1, 2), keepdim=True)
    tiny = (peak > 0) & (peak < 0.5)
    return torch.where(tiny, (coverage / peak.clamp_min(1e-6)).clamp(0, 1), coverage)


def geometry_to_grid(geometry: Geometry | None, size: tuple[int, int]) -> Surfaces | None:
    """Surfaces at the grid's pixel centres; depth is picked, never averaged across an edge."""
    if geometry is None:
        return None
    height, width = size
    rows = _nearest(geometry.depth_m.shape[0], height)
    columns = _nearest(geometry.depth_m.shape[1], width)
    camera = geometry.camera.resized(width, height)
    depth, normal = geometry.depth_m[rows][:, columns], geometry.normal[rows][:, columns]
    return surfaces_of(depth, normal, camera)


def lights_at_full_size(
    fields: LightFields,
    small: OnGrid,
    photo: Float[Tensor, "3 h w"],
    masks: Bool[Tensor, "k h w"],
    on: Bool[Tensor, " k"],
) -> tuple[Float[Tensor, "k 3 h w"], Float[Tensor, "3 h w"]]:
    """Every lamp's linear light and the ambient, with edges where the photo has them.

    A fast guided filter (He and Sun 2015): in every window a field is a line of the guide, and the
    line's two coefficients are what is enlarged. Fractions are brought back to a sum of exactly 1.
    One lamp after the other, so that 12 megapixels stay small.
    """
    if small.photo.shape == photo.shape:
        return lamp_light(fields, photo, on), fields.fraction[0] * photo
    guides, size = (_guide(small.photo), _guide(photo)), photo.shape[1:]
    shares = _guided(fields.fraction, *guides).clamp_(min=0)
    shares /= shares.sum(0).clamp_min_(1e-6)
    lights, ambient = shares[1:], shares[0] * photo
    clipped = bool((photo.amax(0) > CLIPPED).any())
    for lamp, burning in enumerate(on.tolist()):
        if burning and not clipped:
            lights[lamp] *= photo
        elif burning:
            boost = _enlarged(fields.log_boost[lamp : lamp + 1], size)[0]
            lights[lamp] = burning_light(photo, lights[lamp], boost)
        else:
            field = fields.log_ratio[lamp]
            ratio = _guided(_filled(field, small.masks[lamp] <= EDGE_COVERAGE), *guides)
            # What glows ends where its mask does, and nothing of it spills onto the wall.
            inside = _enlarged(_filled(field, small.covered[lamp])[None], size)[0]
            lights[lamp] = unlit_light(photo, torch.where(masks[lamp], inside, ratio))
    return lights, ambient


def _filled(field: Float[Tensor, "3 y x"], known: Bool[Tensor, "y x"]) -> Float[Tensor, "3 y x"]:
    """The field with what is not `known` taken from its neighbours that are; as it was where none
    is near."""
    counted = known[None].to(field)
    weight = _box(counted, FILL_RADIUS)
    nearby = _box(field * counted, FILL_RADIUS) / weight.clamp_min(1e-6)
    return torch.where(known | (weight <= 0), field, nearby)


def _guide(photo: Tensor) -> Tensor:
    """[1 1 h w] stops of luminance, a quarter each: edges count by contrast, not by brightness."""
    return torch.log2(photo.mean(0) + 1e-3)[None, None] / 4


def _guided(field: Tensor, guide_small: Tensor, guide: Tensor) -> Tensor:
    """[n 3 y x] → [n 3 h w]; one plane at a time, so that 12 megapixels stay small."""
    planes = field.reshape(-1, 1, *field.shape[-2:])
    size = guide.shape[-2:]
    mean = _box(guide_small)
    variance = (_box(guide_small**2) - mean**2).clamp_min(0) + GUIDE_SMOOTHNESS
    full = torch.empty(len(planes), *size)
    for index, plane in enumerate(planes):
        plane = plane[None]
        level = _box(plane)
        slope = (_box(plane * guide_small) - level * mean) / variance
        # Detail of the field that the guide does not explain (a soft shadow edge) is kept as is.
        base = plane - slope * guide_small
        slope, base = _enlarged(slope, size), _enlarged(base, size)
        full[index] = torch.addcmul(base, slope, guide)[0, 0]
    return full.reshape(*field.shape[:-2], *size)


def _enlarged(plane: Tensor, size: tuple[int, int] | torch.Size) -> Tensor:
    return fn.interpolate(plane, tuple(size), mode="bilinear", align_corners=False)


def _box(plane: Tensor, radius: int = GUIDE_RADIUS) -> Tensor:
    """Mean over a square window, by the pixels that exist."""
    return fn.avg_pool2d(plane, 2 * radius + 1, stride=1, padding=radius, count_include_pad=False)


def _nearest(source: int, target: int) -> np.ndarray:
    return np.minimum(((np.arange(target) + 0.5) * source / target).astype(int), source - 1)
