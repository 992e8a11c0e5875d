"""Training pairs of the single-view model: a photo, a lamp's mask, an instruction, the answer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.random import Generator
from torch import Tensor

from luxcore.errors import InputError
from luxcore.light.agx import agx
from luxcore.models.diffusion.brackets import olat_exposure, olat_picture
from luxcore.models.diffusion.randomness import numpy_generator
from luxcore.models.diffusion.rooms import KindedView
from luxcore.models.diffusion.schedule import ExampleKey
from luxcore.models.flux_kontext.prompts import (
    Brightness,
    LightKind,
    LightOffPrompt,
    OlatPrompt,
    Prompt,
    all_prompts,
    kind_named,
)
from luxcore.models.small.examples import recompose
from luxcore.models.small.samples import LitGroups, LitView, chw
from luxcore.settings.paper_models import DataSettings

ATTEMPTS = 100
"""Photos drawn until one shows a lamp."""


@dataclass(frozen=True)
class EditExamples:
    """Newly lit photos of `groups` with one of the two tasks (paper, supplement, "On-the-fly
    sampling"): photo to OLAT at a brightness, or photo to photo with the lamp off."""

    groups: LitGroups
    settings: DataSettings
    seed: int

    def __getitem__(self, key: ExampleKey) -> dict[str, Tensor]:
        """`photo` and `target` [3, h, w] display, `mask` [1, h, w], `prompt` its index."""
        rng = numpy_generator(self.seed, key.position)
        view, lamp = self._view_with_lamp(rng)
        prompt, target = self._task(view, lamp, rng)
        return {
            "photo": chw(agx(view.image_linear)),
            "target": chw(target),
            "mask": torch.from_numpy(view.masks[lamp].astype(np.float32))[None],
            "prompt": torch.tensor(all_prompts().index(prompt)),
        }

    def _view_with_lamp(self, rng: Generator) -> tuple[LitView, int]:
        for _ in range(ATTEMPTS):
            view = recompose(self.groups.group(int(rng.integers(2**31)), 1), rng)[0]
            shown = np.flatnonzero(view.masks.any((1, 2)))
            if len(shown):
                return view, int(rng.choice(shown))
        raise InputError(f"none of {ATTEMPTS} training photos shows a lamp.")

    def _task(self, view: LitView, lamp: int, rng: Generator) -> tuple[Prompt, np.ndarray]:
        named = isinstance(view, KindedView)
        kind = kind_named(view.kinds[lamp]) if named else LightKind.LIGHT
        wants_off = rng.random() < self.settings.one_light_off_ratio
        brightness = Brightness(rng.choice(list(Brightness)))
        light = view.lights[lamp]
        if wants_off and view.on[lamp]:
            return LightOffPrompt(kind), agx(view.image_linear - light)
        picture = olat_picture(light, olat_exposure([light]), brightness.exposure_ev)
        return OlatPrompt(kind, brightness), picture


def prompts_of(examples: Sequence[dict[str, Tensor]]) -> list[Prompt]:
    """The instructions of a batch."""
    known = all_prompts()
    return [known[int(example["prompt"])] for example in examples]
