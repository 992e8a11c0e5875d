"""Random conditions of the multi-view model."""

from __future__ import annotations

import torch

from luxcore.models.multiview_unet.condition import Condition

LATENT = 4


def condition(views: int, references: int, scenes: int = 1, edits: bool = False) -> Condition:
    generator = torch.Generator().manual_seed(views)

    def latents(channels: int) -> torch.Tensor:
        return torch.randn(scenes, views, channels, LATENT, LATENT, generator=generator)

    is_reference = torch.zeros(scenes, views, dtype=torch.bool)
    is_reference[:, :references] = True
    return Condition(
        photo=latents(4),
        reference=latents(4),
        is_reference=is_reference,
        rays=latents(6),
        task=torch.zeros(scenes),
        present=torch.ones(scenes, views, dtype=torch.bool),
        light_mask=latents(1).abs() if edits else None,
    )
