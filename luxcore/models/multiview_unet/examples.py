"""Training scenes of the multi-view model: photos, lit pictures, and which of them are given."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from numpy.random import Generator
from torch import Tensor
from torch.nn import functional

from luxcore.errors import InputError
from luxcore.light.agx import agx
from luxcore.models.diffusion.brackets import BRACKETS_EV, olat_exposure, olat_picture
from luxcore.models.diffusion.randomness import numpy_generator
from luxcore.models.diffusion.schedule import ExampleKey
from luxcore.models.multiview_unet.rays import plucker_rays
from luxcore.models.small.examples import recompose
from luxcore.models.small.samples import LitGroups, LitView, chw
from luxcore.settings.paper_models import DataSettings, MultiViewSettings

ATTEMPTS = 100
"""Groups drawn until one shows a lamp."""

LATENT_PX = 8
"""Pixels along a latent's side."""


@dataclass(frozen=True)
class ViewExamples:
    """Overlapping views of one room under one light, and one lamp to harmonize."""

    groups: LitGroups
    data: DataSettings
    model: MultiViewSettings
    seed: int

    def __getitem__(self, key: ExampleKey) -> dict[str, Tensor]:
        """Padded to `key.views` views: `photo`, `target` [v, 3, h, w] display, `mask`
        [v, 1, h, w], `rays` [v, 6, h/8, w/8], `is_reference`, `present` [v], `task` (0 or 1).

        References are views that show the lamp, and never all views: something is left to learn.
        A fraction of the examples loses its condition, for guidance.
        """
        rng = numpy_generator(self.seed, key.position)
        views, lamp = self._views_with_lamp(key.views, rng)
        masks = np.stack([view.masks[lamp] for view in views]).astype(np.float32)
        is_reference = self._references(masks.any((1, 2)), rng)
        off = bool(views[0].on[lamp]) and rng.random() < self.data.one_light_off_ratio
        if rng.random() < self.model.reference_dropout:
            is_reference[:] = False
            masks[:] = 0
        height, width = masks.shape[-2:]
        example = {
            "photo": torch.stack([chw(agx(view.image_linear)) for view in views]),
            "target": torch.stack([chw(p) for p in _targets(views, lamp, off, is_reference, rng)]),
            "mask": torch.from_numpy(masks)[:, None],
            "rays": plucker_rays(
                [view.camera for view in views], height // LATENT_PX, width // LATENT_PX
            ),
            "is_reference": torch.from_numpy(is_reference),
            "present": torch.ones(len(views), dtype=torch.bool),
        }
        padded = {name: _padded(value, key.views) for name, value in example.items()}
        return {**padded, "task": torch.tensor(float(off))}

    def _views_with_lamp(self, count: int, rng: Generator) -> tuple[list[LitView], int]:
        for _ in range(ATTEMPTS):
            views = recompose(self.groups.group(int(rng.integers(2**31)), count)[:count], rng)
            shown = np.flatnonzero(np.any([view.masks.any((1, 2)) for view in views], axis=0))
            if len(shown):
                return views, int(rng.choice(shown))
        raise InputError(f"none of {ATTEMPTS} groups of training photos shows a lamp.")

    def _references(self, shows_lamp: np.ndarray, rng: Generator) -> np.ndarray:
        chosen = np.zeros(len(shows_lamp), bool)
        if self.model.variant == "mv-edit":
            return chosen
        candidates = rng.permutation(np.flatnonzero(shows_lamp))
        most = min(len(candidates), self.model.max_references, len(shows_lamp) - 1)
        if most > 0:
            chosen[candidates[: rng.integers(1, most + 1)]] = True
        return chosen


def _targets(
    views: list[LitView], lamp: int, off: bool, is_reference: np.ndarray, rng: Generator
) -> list[Float[np.ndarray, "h w 3"]]:
    """Lit pictures: all at one exposure, taken from the references as at inference."""
    if off:
        return [agx(view.image_linear - view.lights[lamp]) for view in views]
    given = np.flatnonzero(is_reference)
    measured = given if len(given) else range(len(views))
    exposure = olat_exposure([views[i].lights[lamp] for i in measured])
    exposure_ev = float(rng.choice(BRACKETS_EV))
    return [olat_picture(view.lights[lamp], exposure, exposure_ev) for view in views]


def _padded(tensor: Tensor, views: int) -> Tensor:
    missing = views - tensor.shape[0]
    return functional.pad(tensor, (0, 0) * (tensor.ndim - 1) + (0, missing)) if missing else tensor
