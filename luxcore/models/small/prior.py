"""A first guess at each lamp's share of the photo: Lambert's law with fitted lamp powers.

If all surfaces were of one colour and cast no shadow, the photo would be Σ_i s_i · E_i + a, where
E_i is the irradiance of lamp i at unit power. The powers s and the ambient a that fit the photo
best are a small non-negative least-squares problem; what each term explains is the guess. It tells
the network, which sees one lamp at a time, how the lamps compare.
"""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from luxcore.models.small.levels import CLIPPED
from luxcore.models.small.surfaces import Surfaces, lambert_terms

FALLOFF = 0.15
"""Without geometry light falls off in the picture: to one half at this share of the long side."""

MAX_FIT_PIXELS = 1500
RELATIVE_FLOOR = 0.02
"""As in the scale-factor solver: errors count relative to pixel + 0.02."""


def unit_irradiance(
    masks: Float[Tensor, "k h w"],
    surfaces: Surfaces | None,
    centres: Float[Tensor, "k 3"] | None,
    known: Bool[Tensor, " k"] | None,
) -> Float[Tensor, "k h w"]:
    """cos/d² (clipped to 4/m²) of each lamp where its place is known, else a falloff around its
    mask; 0 for a lamp with neither. A lamp's own mask glows: ten times its largest value."""
    fields = []
    for index, mask in enumerate(masks):
        if surfaces is not None and centres is not None and known is not None and known[index]:
            field = lambert_terms(surfaces, centres[index])[2].clamp_max(4)
        else:
            field = _falloff(mask)
        fields.append(torch.where(mask > 0.5, 10 * field.amax().clamp_min(1e-3), field))
    return torch.stack(fields) if fields else masks


def lambert_shares(
    photo: Float[Tensor, "3 h w"],
    masks: Float[Tensor, "k h w"],
    irradiance: Float[Tensor, "k h w"],
    on: Bool[Tensor, " k"],
) -> Float[Tensor, "k 3 h w"]:
    """Share (0..1) of each pixel and channel that the fit gives to each lamp; 0 when off."""
    shares = torch.zeros(len(masks), 3, *masks.shape[1:])
    burning = torch.nonzero(on)[:, 0]
    if not len(burning):
        return shares
    basis = torch.cat([irradiance[burning], torch.ones_like(irradiance[:1])])
    basis = basis / basis.flatten(1).mean(1).clamp_min(1e-6)[:, None, None]
    usable = (photo.amax(0) < CLIPPED) & (masks.amax(0) < 0.1)
    for channel in range(3):
        powers = _fit(photo[channel], basis, usable)
        parts = basis * powers[:, None, None]
        shares[burning, channel] = (parts / parts.sum(0).clamp_min(1e-6))[:-1]
    return shares


def _fit(
    plane: Float[Tensor, "h w"], basis: Float[Tensor, "b h w"], usable: Bool[Tensor, "h w"]
) -> Float[Tensor, " b"]:
    from scipy.optimize import nnls

    values, columns = plane[usable].numpy(), basis[:, usable].numpy().T
    step = max(1, len(values) // MAX_FIT_PIXELS)
    values, columns = values[::step].astype(np.float64), columns[::step].astype(np.float64)
    if len(values) < columns.shape[1]:
        return torch.ones(len(basis))
    weight = 1 / (values + RELATIVE_FLOOR)
    # A little of everything stays: a share of exactly zero would tell the network too much.
    powers = nnls(columns * weight[:, None], values * weight)[0] + 1e-3 * values.mean()
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
