"""A photo, a mask and their tensors, and the settings of the tiny single-view models."""

from __future__ import annotations

from pathlib import Path

import torch

from luxcore.models.flux_kontext.editor import Editor
from luxcore.models.flux_kontext.embeddings import PromptEmbeddings
from luxcore.models.flux_kontext.prompts import all_prompts
from luxcore.settings.paper_models import KontextSettings

SIDE = 64


def settings_of(base: Path, variant: str = "mask-add", **more: object) -> KontextSettings:
    return KontextSettings(base=str(base), variant=variant, lora_rank=4, prompt_tokens=16, **more)


def photo_and_mask() -> tuple[torch.Tensor, torch.Tensor]:
    photo = torch.rand(1, 3, SIDE, SIDE, generator=torch.Generator().manual_seed(2))
    mask = torch.zeros(1, 1, SIDE, SIDE)
    mask[..., 5:40, 12:30] = 1
    return photo, mask


def tensors(editor: Editor, embeddings: PromptEmbeddings) -> dict[str, torch.Tensor]:
    mask = photo_and_mask()[1]
    generator = torch.Generator().manual_seed(4)
    clean, noise, condition = (torch.randn(1, 16, 8, 8, generator=generator) for _ in range(3))
    sequence, pooled = embeddings.batch([all_prompts()[0]])
    return {
        "clean": clean,
        "noise": noise,
        "level": torch.tensor([0.5]),
        "condition": condition,
        "mask": editor.mask_input(mask),
        "sequence": sequence.float(),
        "pooled": pooled.float(),
    }
