"""The single-view model as the training loop sees it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from torch.optim import AdamW, Optimizer

from luxcore.models.diffusion.frames import to_picture
from luxcore.models.diffusion.latents import encode
from luxcore.models.diffusion.randomness import torch_generator
from luxcore.models.diffusion.schedule import ExampleKey
from luxcore.models.diffusion.trainee import Example
from luxcore.models.flux_kontext.editor import Editor
from luxcore.models.flux_kontext.embeddings import PromptEmbeddings
from luxcore.models.flux_kontext.examples import EditExamples, prompts_of
from luxcore.models.flux_kontext.weights_folder import save_editor
from luxcore.settings.paper_models import KontextSampling, KontextTraining

VALIDATION_POSITIONS = (2**40, 2**40 + 1)
"""Examples drawn as validation pictures: positions that no training reaches."""

NOISE_STREAM = 1
"""Keeps an example's noise apart from the drawing of the example itself."""


@dataclass
class KontextTrainee:
    """Prodigy on LoRA and mask layer (paper, supplement), or AdamW on the whole U-Net for `sd`."""

    editor: Editor
    embeddings: PromptEmbeddings
    examples: EditExamples
    settings: KontextTraining

    @property
    def module(self) -> nn.Module:
        return self.editor.module

    def optimizer(self, parameters: Sequence[nn.Parameter]) -> Optimizer:
        rate = self.settings.learning_rate
        if self.settings.model.variant == "sd":
            return AdamW(parameters, lr=rate)
        from prodigyopt import Prodigy

        return Prodigy(parameters, lr=rate, safeguard_warmup=True, use_bias_correction=True)

    def batch(
        self, keys: Sequence[ExampleKey], examples: Sequence[Example], device: torch.device
    ) -> dict[str, Tensor]:
        vae = self.editor.vae.to(device)
        photo, target, mask = (
            torch.stack([example[name] for example in examples]).to(device)
            for name in ("photo", "target", "mask")
        )
        seed = self.settings.loop.seed
        generators = [torch_generator(seed, key.position, NOISE_STREAM) for key in keys]
        clean = encode(vae, target)
        noise = [torch.randn(clean.shape[1:], generator=generator) for generator in generators]
        level = [self.editor.module.draw_level(generator) for generator in generators]
        sequence, pooled = self.embeddings.batch(prompts_of(examples))
        return {
            "clean": clean,
            "noise": torch.stack(noise).to(device),
            "level": torch.stack(level).to(device),
            "condition": encode(vae, photo),
            "mask": self.editor.mask_input(mask),
            "sequence": sequence.to(device, vae.dtype),
            "pooled": pooled.to(device, vae.dtype),
        }

    def pictures(self) -> Mapping[str, np.ndarray]:
        """Photo, answer and truth side by side."""
        sampling = KontextSampling(guidance=self.settings.model.training_guidance)
        rows = {}
        for position in VALIDATION_POSITIONS:
            example = self.examples[ExampleKey(position, 1)]
            photo, mask, target = (example[name][None] for name in ("photo", "mask", "target"))
            prompt = prompts_of([example])[0]
            self.editor.module.eval()
            made = self.editor.edit(photo, mask, prompt, self.embeddings, sampling, seed=0)
            row = torch.cat([photo, made.cpu(), target], dim=-1)
            rows[f"{prompt.text.split('.')[0].lower()}_{position % 2**40}"] = to_picture(
                row, (row.shape[-2], row.shape[-1])
            )
        return rows

    def export(self, folder: Path) -> None:
        save_editor(folder, self.editor, self.embeddings, self.settings.model)
