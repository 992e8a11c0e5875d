"""The mask decides: what glows inside a lamp's mask is that lamp, and no other lamp lights it up.

A glowing shade reflects other lamps' light like the things around it and adds its own. So inside
the emitter of lamp j the light of every other lamp is held at what its surroundings show, and the
rest goes to lamp j.
"""

from __future__ import annotations

import numpy as np
import torch
import torch.nn.functional as fn
from jaxtyping import Bool, Float
from torch import Tensor

EMITTER_SHARE = 0.25
"""A pixel of a mask glows when it is brighter than this share of the mask's 95th percentile."""

RING = 0.02
"""Width of the surroundings that are looked at, in long sides of the photo."""

RING_QUANTILE = 0.75


def emitter_masks(
    photo: Float[Tensor, "3 h w"], masks: Bool[Tensor, "k h w"]
) -> Bool[Tensor, "k h w"]:
    """The glowing part of each mask: a fixture's stand and arm reflect, its bulb and shade glow."""
    brightness = photo.amax(0)
    glowing = torch.zeros_like(masks)
    for index, mask in enumerate(masks):
        if bool(mask.any()):
            peak = _quantile(brightness[mask], 0.95)
            glowing[index] = mask & (brightness >= EMITTER_SHARE * peak)
    return glowing


def keep_out_of_emitters(
    lights: Float[Tensor, "k 3 h w"],
    ambient: Float[Tensor, "3 h w"],
    emitters: Bool[Tensor, "k h w"],
    on: Bool[Tensor, " k"],
) -> tuple[Float[Tensor, "k 3 h w"], Float[Tensor, "3 h w"]]:
    """Lights and ambient with foreign light inside burning emitters held at its surroundings.

    What a burning lamp or the ambient loses there, the emitter's owner gains: the sum of the
    photo's light does not change. Light of a lamp that is off was not in the photo: it just goes.
    """
    lights, ambient = lights.clone(), ambient.clone()
    for owner in range(len(lights)):
        window = _window(emitters[owner]) if bool(on[owner]) else None
        if window is None:
            continue
        rows, columns, ring = window
        part = (slice(None), rows, columns)
        # Where two masks overlap, the first owns the pixel.
        inside = emitters[owner, rows, columns] & ~emitters[:owner, rows, columns].any(0)
        ring &= ~emitters[:, rows, columns].any(0)
        for other in range(len(lights)):
            if other != owner:
                excess = _capped(lights[other][part], inside, ring)
                lights[owner][part] += excess * on[other]
        lights[owner][part] += _capped(ambient[part], inside, ring)
    return lights, ambient


def _capped(light: Tensor, inside: Tensor, ring: Tensor) -> Tensor:
    """Hold `light` ([3 y x], changed in place) inside at the ring's level; returns what was cut."""
    if not bool(inside.any()) or not bool(ring.any()):
        return torch.zeros_like(light)
    level = torch.stack([_quantile(channel[ring], RING_QUANTILE) for channel in light])
    cut = (light - level.view(3, 1, 1)).clamp_min(0) * inside
    light -= cut
    return cut


def _window(emitter: Tensor) -> tuple[slice, slice, Tensor] | None:
    """Rows and columns around an emitter with its ring, and the ring inside that window."""
    rows, columns = torch.nonzero(emitter.any(1)), torch.nonzero(emitter.any(0))
    if not len(rows):
        return None
    width = max(2, round(RING * max(emitter.shape)))
    top, bottom = max(0, int(rows[0]) - width), int(rows[-1]) + width + 1
    left, right = max(0, int(columns[0]) - width), int(columns[-1]) + width + 1
    part = emitter[top:bottom, left:right]
    grown = fn.max_pool2d(part[None].float(), 2 * width + 1, stride=1, padding=width)[0] > 0
    return slice(top, bottom), slice(left, right), grown & ~part


def _quantile(values: Tensor, share: float) -> Tensor:
    # torch.quantile refuses more than 2^24 values; a mask of a large photo may have more.
    return torch.from_numpy(np.asarray(np.quantile(values.numpy(), share))).to(values)
