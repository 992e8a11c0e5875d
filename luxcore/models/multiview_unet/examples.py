"""Training scenes of the multi-view model: photos, lit pictures, and which of them are given."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from numpy.random import Generator
from torch import Tensor
from torch.nn import functional

from luxcore.data.crops import LitCrop
from luxcore.data.lighting import one_light_off
from luxcore.light.agx import agx
from luxcore.light.exposure import BRACKETS_EV
from luxcore.models.diffusion.brackets import olat_exposure, olat_picture
from luxcore.models.diffusion.frames import to_tensor
from luxcore.models.diffusion.randomness import numpy_generator
from luxcore.models.diffusion.rooms import LitSets, set_with_lamp
from luxcore.models.diffusion.schedule import ExampleKey
from luxcore.models.multiview_unet.rays import plucker_rays
from luxcore.settings.paper_models import DataSettings, MultiViewSettings

TASK_STREAM = 2
"""Keeps the drawing of an example's task apart from its noise."""

LATENT_PX = 8
"""Pixels along a latent's side."""


@dataclass(frozen=True)
class ViewExamples:
    """Overlapping views of one room under one light, and one lamp to harmonize."""

    sets: LitSets
    data: DataSettings
    model: MultiViewSettings
    seed: int

    def __getitem__(self, key: ExampleKey) -> dict[str, Tensor]:
        """Padded to `key.views` views: `photo`, `target` [v, 3, h, w] display, `mask`
        [v, 1, h, w], `rays` [v, 6, h/8, w/8], `is_reference`, `present` [v], `task` (0 or 1).

        References are views that show the lamp, and never all views: something is left to learn.
        A fraction of the examples loses its condition, for guidance.
        """
        crops = set_with_lamp(self.sets, key.position, key.views)
        rng = numpy_generator(self.seed, key.position, TASK_STREAM)
        masks = np.stack([crop.masks[0] for crop in crops]).astype(np.float32)
        is_reference = self._references(masks.any((1, 2)), rng)
        off = bool(crops[0].on[0]) and rng.random() < self.data.one_light_off_ratio
        targets = _off(crops) if off else _olats(crops, is_reference, rng)
        if rng.random() < self.model.reference_dropout:
            is_reference[:] = False
            masks[:] = 0
        height, width = masks.shape[-2:]
        example = {
            "photo": _stacked([agx(c.image_linear * np.float32(c.exposure)) for c in crops]),
            "target": _stacked(targets),
            "mask": torch.from_numpy(masks)[:, None],
            "rays": plucker_rays(
                [crop.camera for crop in crops], height // LATENT_PX, width // LATENT_PX
            ),
            "is_reference": torch.from_numpy(is_reference),
            "present": torch.ones(len(crops), dtype=torch.bool),
        }
        padded = {name: _padded(value, key.views) for name, value in example.items()}
        return {**padded, "task": torch.tensor(float(off))}

    def _references(self, shows_lamp: np.ndarray, rng: Generator) -> np.ndarray:
        chosen = np.zeros(len(shows_lamp), bool)
        if self.model.variant == "mv-edit":
            return chosen
        candidates = rng.permutation(np.flatnonzero(shows_lamp))
        most = min(len(candidates), self.model.max_references, len(shows_lamp) - 1)
        if most > 0:
            chosen[candidates[: rng.integers(1, most + 1)]] = True
        return chosen


def _off(crops: list[LitCrop]) -> list[Float[np.ndarray, "h w 3"]]:
    return [agx(one_light_off(crop, 0) * np.float32(crop.exposure)) for crop in crops]


def _olats(
    crops: list[LitCrop], is_reference: Bool[np.ndarray, " v"], rng: Generator
) -> list[Float[np.ndarray, "h w 3"]]:
    """OLATs of all views at one exposure, taken from the references as at inference."""
    given = np.flatnonzero(is_reference)
    measured = given if len(given) else range(len(crops))
    exposure = olat_exposure([crops[i].lights[0] for i in measured])
    exposure_ev = BRACKETS_EV[rng.integers(len(BRACKETS_EV))]
    return [olat_picture(crop.lights[0], exposure, exposure_ev) for crop in crops]


def _stacked(pictures: list[Float[np.ndarray, "h w 3"]]) -> Float[Tensor, "v 3 h w"]:
    size = (pictures[0].shape[0], pictures[0].shape[1])
    return torch.cat([to_tensor(picture, size) for picture in pictures])


def _padded(tensor: Tensor, views: int) -> Tensor:
    missing = views - tensor.shape[0]
    return functional.pad(tensor, (0, 0) * (tensor.ndim - 1) + (0, missing)) if missing else tensor
