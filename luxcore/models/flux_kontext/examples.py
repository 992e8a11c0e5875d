"""Training pairs of the single-view model: a photo, a lamp's mask, an instruction, the answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from numpy.random import Generator
from torch import Tensor

from luxcore.data.crops import LitCrop
from luxcore.data.lighting import one_light_off
from luxcore.light.agx import agx
from luxcore.models.diffusion.brackets import olat_exposure, olat_picture
from luxcore.models.diffusion.frames import to_tensor
from luxcore.models.diffusion.randomness import numpy_generator
from luxcore.models.diffusion.rooms import LitPhotos, photo_with_lamp
from luxcore.models.diffusion.schedule import ExampleKey
from luxcore.models.flux_kontext.prompts import (
    Brightness,
    LightOffPrompt,
    OlatPrompt,
    Prompt,
    all_prompts,
    kind_named,
)
from luxcore.settings.paper_models import DataSettings

TASK_STREAM = 2
"""Keeps the drawing of an example's task apart from its noise."""


@dataclass(frozen=True)
class EditExamples:
    """Newly lit photos with one of the two tasks (paper, supplement, "On-the-fly sampling"):
    photo to OLAT at a brightness, or photo to photo with the lamp off."""

    photos: LitPhotos
    settings: DataSettings
    seed: int

    def __getitem__(self, key: ExampleKey) -> dict[str, Tensor]:
        """`photo` and `target` [3, h, w] display, `mask` [1, h, w], `prompt` its index."""
        crop = photo_with_lamp(self.photos, key.position)
        rng = numpy_generator(self.seed, key.position, TASK_STREAM)
        prompt, target = self._task(crop, rng)
        photo = agx(crop.image_linear * np.float32(crop.exposure))
        size = (photo.shape[0], photo.shape[1])
        return {
            "photo": to_tensor(photo, size)[0],
            "target": to_tensor(target, size)[0],
            "mask": torch.from_numpy(crop.masks[0].astype(np.float32))[None],
            "prompt": torch.tensor(all_prompts().index(prompt)),
        }

    def _task(self, crop: LitCrop, rng: Generator) -> tuple[Prompt, Float[np.ndarray, "h w 3"]]:
        kind = kind_named(crop.kinds[0])
        wants_off = rng.random() < self.settings.one_light_off_ratio
        brightness = list(Brightness)[rng.integers(len(Brightness))]
        if wants_off and crop.on[0]:
            return LightOffPrompt(kind), agx(one_light_off(crop, 0) * np.float32(crop.exposure))
        light = crop.lights[0]
        picture = olat_picture(light, olat_exposure([light]), brightness.exposure_ev)
        return OlatPrompt(kind, brightness), picture


def prompts_of(examples: Sequence[Mapping[str, Tensor]]) -> list[Prompt]:
    """The instructions of a batch."""
    known = all_prompts()
    return [known[int(example["prompt"])] for example in examples]
