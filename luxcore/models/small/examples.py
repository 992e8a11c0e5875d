"""Training photos on the network's grid: exposed, and clipped as a camera would."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from luxcore.data.crops import LitCrop
from luxcore.models.small.heads import LightFields, OnGrid, WarpedLight, light_fields
from luxcore.models.small.levels import PHOTO_MAX
from luxcore.models.small.samples import chw
from luxcore.models.small.surfaces import Surfaces, surfaces_of

LIGHT_MAX = 4_000.0
"""Lamp light above this is clipped in training: beyond every bracket, and rare."""


@dataclass(frozen=True)
class Example:
    """One photo as tensors, with its truth. `photo` is what the network may see.

    `lights` [k] and `ambient` are truth and not clipped; lamps that the photo does not show are
    part of `ambient` when they burn.
    """

    photo: Float[Tensor, "3 h w"]
    masks: Float[Tensor, "k h w"]
    on: Bool[Tensor, " k"]
    surfaces: Surfaces | None
    lights: Float[Tensor, "k 3 h w"]
    ambient: Float[Tensor, "3 h w"]
    warped: WarpedLight | None = None
    """Light of references, for the multi-view model."""

    @property
    def seen(self) -> OnGrid:
        """What the heads are told."""
        return OnGrid(self.photo, self.masks)

    def fields(self, outputs: Float[Tensor, "k o h w"]) -> LightFields:
        """What a network's `outputs` for this photo say."""
        return light_fields(outputs, self.on, self.seen, self.warped)


def to_example(
    crop: LitCrop,
    *,
    geometry: bool,
    flip: bool = False,
    keep: Bool[np.ndarray, " k"] | None = None,
) -> Example:
    """Tensors of a photo. Lamps in `keep` stay lamps (default: those that the photo shows)."""
    seen = crop.masks.any((1, 2)) if keep is None else keep
    hidden = crop.on & ~seen
    exposure = np.float32(crop.exposure)
    ambient = chw(exposure * (crop.ambient + crop.lights[hidden].sum(0)))
    lights = chw(exposure * crop.lights[seen])
    on = torch.from_numpy(crop.on[seen])
    photo = (ambient + lights[on].sum(0)).clamp(0, PHOTO_MAX)
    surfaces = surfaces_of(crop.depth_m, crop.normal, crop.camera) if geometry else None
    masks = torch.from_numpy(crop.masks[seen].astype(np.float32))
    example = Example(photo, masks, on, surfaces, lights.clamp(0, LIGHT_MAX), ambient)
    return _flipped(example) if flip else example


def _flipped(example: Example) -> Example:
    """The mirror image: x turns round in the picture and in camera space."""
    mirror = torch.tensor([-1.0, 1, 1]).view(3, 1, 1)
    surfaces = example.surfaces
    if surfaces is not None:
        points, normals = surfaces.points.flip(-1) * mirror, surfaces.normals.flip(-1) * mirror
        fx, fy, cx, cy = surfaces.pinhole
        mirrored = (fx, fy, example.photo.shape[2] - cx, cy)
        surfaces = replace(surfaces, points=points, normals=normals, pinhole=mirrored)
    return Example(
        example.photo.flip(-1),
        example.masks.flip(-1),
        example.on,
        surfaces,
        example.lights.flip(-1),
        example.ambient.flip(-1),
    )
