"""The small single-view model behind the project's `Decomposer` interface."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from luxcore.models.interface import Decomposition, Geometry
from luxcore.models.small.emitters import emitter_masks, keep_out_of_emitters
from luxcore.models.small.features import lamp_features
from luxcore.models.small.geometry import estimate_surfaces
from luxcore.models.small.grid import (
    geometry_to_grid,
    grid_size,
    lights_at_full_size,
    masks_to_grid,
    photo_to_grid,
)
from luxcore.models.small.heads import LightFields, OnGrid, WarpedLight, light_fields
from luxcore.models.small.network import SV_OUTPUTS, UNet
from luxcore.models.small.samples import chw


@dataclass(frozen=True)
class SmallDecomposer:
    """Light fractions at `long_side_px`, carried to the photo's own size. Deterministic.

    `estimator` guesses the geometry of photos that come without; None leaves it unknown.
    """

    net: UNet
    long_side_px: int
    estimator: UNet | None = None
    name: str = "small"

    def decompose(
        self,
        image_linear: Float[np.ndarray, "h w 3"],
        masks: Bool[np.ndarray, "k h w"],
        on: Bool[np.ndarray, " k"],
        geometry: Geometry | None,
        seed: int,
    ) -> Decomposition:
        """See `luxcore.models.interface.Decomposer`; `seed` changes nothing here."""
        shown = masks.any((1, 2))
        if not shown.all():
            part = self.decompose(image_linear, masks[shown], on[shown], geometry, seed)
            return with_unseen(part, shown)
        height, width = image_linear.shape[:2]
        size = grid_size(height, width, self.long_side_px, self._stride())
        small = photo_to_grid(image_linear, size)
        burning = torch.from_numpy(on)
        surfaces = geometry_to_grid(geometry, size)
        if surfaces is None and self.estimator is not None:
            surfaces = estimate_surfaces(self.estimator, small)
        seen = OnGrid(small, masks_to_grid(masks, size))
        features = lamp_features(small, seen.masks, burning, surfaces)
        fields = run_network(self.net, features, burning, seen)
        return finish(fields, seen, image_linear, masks, burning)

    def _stride(self) -> int:
        """Sides of the grid are multiples of what both networks need."""
        return math.lcm(*(n.shape.stride for n in (self.net, self.estimator) if n is not None))


def run_network(
    net: UNet,
    features: Float[Tensor, "k c y x"],
    on: Bool[Tensor, " k"],
    small: OnGrid,
    warped: WarpedLight | None = None,
) -> LightFields:
    """The light fields of one photo on the grid; K = 0 needs no network."""
    if not len(features):
        return light_fields(features.new_zeros(0, SV_OUTPUTS, *features.shape[-2:]), on, small)
    with torch.inference_mode():
        outputs = net(features.contiguous(memory_format=torch.channels_last))
    return light_fields(outputs.clone(), on, small, warped)


def finish(
    fields: LightFields,
    small: OnGrid,
    image_linear: Float[np.ndarray, "h w 3"],
    masks: Bool[np.ndarray, "k h w"],
    on: Bool[Tensor, " k"],
) -> Decomposition:
    """Light fields and the full photo to a decomposition that adds up.

    Emitters of lamps that are on keep foreign light out; where a lamp that is off will glow, its
    own light stays. Scales are 1 for lamps that are on: `olat` is then the lamp's share itself.
    """
    photo = chw(image_linear).clamp_min(0)
    covered = torch.from_numpy(masks)
    lights, ambient = lights_at_full_size(fields, small, photo, covered, on)
    lights, ambient = keep_out_of_emitters(lights, ambient, emitter_masks(photo, covered), on)
    scale = on.float()[:, None].expand(-1, 3)
    return Decomposition(_hwc(ambient), _hwc(lights), scale.numpy().copy())


def with_unseen(part: Decomposition, seen: Bool[np.ndarray, " k"]) -> Decomposition:
    """Lamps that the photo does not show get no light: what they send belongs to ambient."""
    olat = np.zeros((len(seen), *part.ambient.shape), np.float32)
    scale = np.zeros((len(seen), 3), np.float32)
    olat[seen], scale[seen] = part.olat, part.scale
    return Decomposition(part.ambient, olat, scale)


def _hwc(image: Tensor) -> np.ndarray:
    return np.ascontiguousarray(image.movedim(-3, -1).numpy())
