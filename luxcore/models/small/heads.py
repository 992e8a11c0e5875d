"""From the network's answers about K lamps to one decomposition that adds up exactly.

The photo is split, not repainted: every lamp that is on, and the ambient rest, gets an RGB fraction
of each pixel, and the fractions sum to 1 (softmax over lamps and ambient). So texture stays exact
and OLATs, one-light-off pictures and all brackets agree. Where the photo is clipped, a boost
restores what the lamp sent beyond it.

A lamp that is off has no fraction: its light is the photo times an unbounded ratio. How it will
glow itself does not show in the photo, but follows from the light that it sends: a lamp's own
mask is GLOW brighter, more or less, than what it lights up.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as fn
from jaxtyping import Bool, Float
from torch import Tensor

from luxcore.models.small.levels import CLIPPED
from luxcore.models.small.network import SV_OUTPUTS

MAX_LOG_RATIO = 8.0
"""Natural log of the largest ratio between a switched-off lamp's light and the photo."""

MAX_LOG_BOOST = 6.0
"""Natural log of the largest boost of a clipped emitter: 400 times white."""

RATIO_FLOOR = 0.02
"""Added to the photo before the ratio multiplies it: black pixels can be lit as well."""

GLOW = 4.0
"""Natural log of a burning lamp's own light (its mask's brightest tenth) over the root mean square
of what it sends to the rest of a photo: the median over 220 lamps of rooms that no weights had
seen, 3.7 in the mean, with a standard deviation of 1.5."""


@dataclass(frozen=True)
class OnGrid:
    """A photo and the coverage (0..1) of its lamps' masks at one resolution."""

    photo: Float[Tensor, "3 h w"]
    masks: Float[Tensor, "k h w"]

    @property
    def covered(self) -> Bool[Tensor, "k h w"]:
        """Where a mask has most of a pixel."""
        return self.masks > 0.5


@dataclass(frozen=True)
class LightFields:
    """What the network says about one photo; everything but `photo` is smooth enough to upsample.

    `fraction[0]` is ambient's, `fraction[1 + k]` lamp k's (0 when off); they sum to 1.
    `log_ratio[k]` and `log_boost[k]` are natural logs.
    """

    fraction: Float[Tensor, "k1 3 h w"]
    log_ratio: Float[Tensor, "k 3 h w"]
    log_boost: Float[Tensor, "k 3 h w"]


@dataclass(frozen=True)
class WarpedLight:
    """Light of the references at the places that a view sees, as a ratio to their own photos.

    `known[k]` is 1 where some reference shows the place and knows lamp k, else 0.
    """

    ratio: Float[Tensor, "k 3 h w"]
    known: Float[Tensor, "k 1 h w"]


def light_fields(
    outputs: Float[Tensor, "k o h w"],
    on: Bool[Tensor, " k"],
    small: OnGrid,
    warped: WarpedLight | None = None,
) -> LightFields:
    """The heads of all lamps of one photo, `small` as the network sees it, brought together.

    With `warped`, the 13th output says how far to trust it, and the answer lies between the
    network's own and the warped one.
    """
    own = _own_fields(outputs[:, :SV_OUTPUTS].float(), on, small)
    if warped is None or outputs.shape[1] == SV_OUTPUTS or not len(outputs):
        return own
    # Trust starts high (0.88): what another view shows of a diffuse surface is nearly the truth.
    trust = warped.known * torch.sigmoid(outputs[:, SV_OUTPUTS:].float() + 2)
    fraction = torch.lerp(own.fraction[1:], warped.ratio.clamp(0, 1), trust) * on.view(-1, 1, 1, 1)
    total = fraction.sum(0, keepdim=True)
    fraction = fraction / total.clamp_min(1)
    ambient = (1 - fraction.sum(0, keepdim=True)).clamp_min(0)
    log_ratio = torch.log(warped.ratio.clamp_min(1e-6)).clamp(-MAX_LOG_RATIO, MAX_LOG_RATIO)
    return LightFields(
        torch.cat([ambient, fraction]),
        torch.lerp(own.log_ratio, log_ratio, trust),
        own.log_boost,
    )


def _own_fields(
    outputs: Float[Tensor, "k o h w"], on: Bool[Tensor, " k"], small: OnGrid
) -> LightFields:
    lamp, ambient, ratio, boost = outputs.chunk(4, dim=1)
    # Each lamp's pass has its own view of the ambient; the burning lamps' mean speaks for it.
    ambient = (
        ambient[on].mean(0, keepdim=True)
        if bool(on.any())
        else ambient.new_zeros(1, *ambient.shape[1:])
    )
    off = ~on.view(-1, 1, 1, 1)
    logits = torch.cat([ambient, lamp.masked_fill(off, float("-inf"))])
    return LightFields(
        logits.softmax(dim=0),
        _unlit_ratio(ratio, boost, small),
        MAX_LOG_BOOST * torch.sigmoid(boost - 2),
    )


def _smoothed(
    field: Float[Tensor, "k 3 h w"], counted: Float[Tensor, "k 3 h w"]
) -> Float[Tensor, "k 3 h w"]:
    """Smoothed over 3×3 of what is `counted` (0 or 1): the network's last upsampling leaves a
    chequerboard of two pixels, which a ratio, that no softmax bounds, would show."""
    return _binomial(field * counted) / _binomial(counted).clamp_min(1e-6)


def _unlit_ratio(
    ratio: Float[Tensor, "k 3 h w"], glow: Float[Tensor, "k 3 h w"], small: OnGrid
) -> Float[Tensor, "k 3 h w"]:
    """The log ratio outside of each lamp's mask, and inside what makes the lamp `glow`."""
    own = small.covered[:, None]
    outside = (~own).to(ratio).expand_as(ratio)
    log_ratio = _smoothed(ratio, outside).clamp(-MAX_LOG_RATIO, MAX_LOG_RATIO)
    photo = small.photo + RATIO_FLOOR
    # Other lamps' emitters are no measure of what this one lights up.
    counted = (~small.covered).all(0).to(photo).expand_as(photo)
    sent = (photo * torch.exp(log_ratio)) ** 2 * counted
    mean_square = sent.sum((2, 3)) / counted.sum((1, 2)).clamp_min(1)
    # How brightly a lamp glows shall teach nothing about what it lights up.
    level = 0.5 * torch.log(mean_square.detach() + 1e-9)[..., None, None]
    inside = level + GLOW + glow - torch.log(photo)
    return torch.where(own, inside.clamp(-MAX_LOG_RATIO, MAX_LOG_RATIO), log_ratio)


def _binomial(field: Float[Tensor, "k 3 h w"]) -> Float[Tensor, "k 3 h w"]:
    taps = field.new_tensor([0.25, 0.5, 0.25])
    kernel = (taps[:, None] * taps)[None, None]
    planes = fn.pad(field.flatten(0, 1)[:, None], (1, 1, 1, 1), mode="replicate")
    return fn.conv2d(planes, kernel).reshape(field.shape)


def lamp_light(
    fields: LightFields, photo: Float[Tensor, "3 h w"], on: Bool[Tensor, " k"]
) -> Float[Tensor, "k 3 h w"]:
    """Linear light of each lamp: what it gives when on, what it would give when off."""
    burning = burning_light(photo, fields.fraction[1:], fields.log_boost)
    return torch.where(on.view(-1, 1, 1, 1), burning, unlit_light(photo, fields.log_ratio))


def burning_light(
    photo: Float[Tensor, "3 h w"],
    fraction: Float[Tensor, "*k 3 h w"],
    log_boost: Float[Tensor, "*k 3 h w"],
) -> Float[Tensor, "*k 3 h w"]:
    """The share of the photo that a burning lamp has, boosted where the photo is clipped."""
    clipped = (photo.amax(0) > CLIPPED).to(photo)
    return fraction * photo * torch.exp(log_boost * clipped)


def unlit_light(
    photo: Float[Tensor, "3 h w"], log_ratio: Float[Tensor, "*k 3 h w"]
) -> Float[Tensor, "*k 3 h w"]:
    """What a lamp that is off would add to the photo."""
    return (photo + RATIO_FLOOR) * torch.exp(log_ratio)
