"""The multi-view model as the training loop sees it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.optim import AdamW, Optimizer

from luxcore.models.diffusion.frames import to_picture
from luxcore.models.diffusion.latents import decode, encode
from luxcore.models.diffusion.randomness import torch_generator
from luxcore.models.diffusion.schedule import ExampleKey
from luxcore.models.diffusion.trainee import Example
from luxcore.models.multiview_unet.condition import Condition, latent_mask
from luxcore.models.multiview_unet.examples import ViewExamples
from luxcore.models.multiview_unet.sampling import sample
from luxcore.models.multiview_unet.weights_folder import MultiViewModel, save_multiview
from luxcore.settings.paper_models import MultiViewSampling, MultiViewTraining

VALIDATION_POSITIONS = (2**40, 2**40 + 1)
"""Examples drawn as validation pictures: positions that no training reaches."""

VALIDATION_VIEWS = 4
"""Views in a validation picture: enough to see whether they agree."""

NOISE_STREAM = 1
"""Keeps an example's noise apart from the drawing of the example itself."""


@dataclass
class MultiViewTrainee:
    """AdamW on all of the U-Net (paper, supplement)."""

    model: MultiViewModel
    examples: ViewExamples
    settings: MultiViewTraining

    @property
    def module(self) -> nn.Module:
        return self.model.module

    def optimizer(self, parameters: Sequence[nn.Parameter]) -> Optimizer:
        return AdamW(parameters, lr=self.settings.learning_rate)

    def batch(
        self, keys: Sequence[ExampleKey], examples: Sequence[Example], device: torch.device
    ) -> dict[str, Tensor]:
        self.model.vae.to(device)
        stacked = {
            name: torch.stack([example[name] for example in examples]).to(device)
            for name in examples[0]
        }
        seed = self.settings.loop.seed
        generators = [torch_generator(seed, key.position, NOISE_STREAM) for key in keys]
        clean = self._latents(stacked["target"])
        noise = [torch.randn(clean.shape[1:], generator=generator) for generator in generators]
        level = [self.model.module.draw_level(generator) for generator in generators]
        batch = {
            "clean": clean,
            "noise": torch.stack(noise).to(device),
            "level": torch.stack(level).to(device),
            "photo": self._latents(stacked["photo"]),
        }
        batch |= {name: stacked[name] for name in ("is_reference", "rays", "task", "present")}
        if self.model.module.edits:
            size = (clean.shape[-2], clean.shape[-1])
            batch["light_mask"] = latent_mask(stacked["mask"], size)
        return batch

    def pictures(self) -> Mapping[str, np.ndarray]:
        """Per scene a column of views: photo, answer and truth side by side."""
        sampling = MultiViewSampling()
        self.model.module.eval()
        device = self.model.vae.device
        drawn = {}
        for position in VALIDATION_POSITIONS:
            key = ExampleKey(position, VALIDATION_VIEWS)
            example = self.examples[key]
            batch = self.batch([key], [example], device)
            condition = Condition(
                photo=batch["photo"],
                reference=batch["clean"],
                is_reference=batch["is_reference"],
                rays=batch["rays"],
                task=batch["task"],
                present=batch["present"],
                light_mask=batch.get("light_mask"),
            )
            latents = sample(
                self.model.module, condition, sampling.steps, sampling.guidance, seed=0
            )
            made = decode(self.model.vae, latents[0]).cpu()
            columns = torch.cat([example["photo"], made, example["target"]], dim=-1)
            column = torch.cat(list(columns), dim=-2)[None]
            drawn[f"scene_{position % 2**40}"] = to_picture(
                column, (column.shape[-2], column.shape[-1])
            )
        return drawn

    def export(self, folder: Path) -> None:
        save_multiview(folder, self.model, self.settings.model)

    def _latents(self, pictures: Float[Tensor, "b v 3 h w"]) -> Float[Tensor, "b v c lh lw"]:
        b, v = pictures.shape[:2]
        return encode(self.model.vae, pictures.flatten(0, 1)).unflatten(0, (b, v))
