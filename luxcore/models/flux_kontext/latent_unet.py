"""The `sd` variant: Stable Diffusion's U-Net with the photo and the mask as input channels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

from luxcore.models.diffusion.noise import TRAINING_STEPS, noise_scheduler, training_target
from luxcore.models.diffusion.widen import widen_input
from luxcore.settings.paper_models import NoiseSettings

if TYPE_CHECKING:
    from diffusers import UNet2DConditionModel


class LatentUNetModule(nn.Module):
    """Channels: noisy latents 4, latents of the photo 4, mask 1. All parameters are trained."""

    def __init__(self, unet: UNet2DConditionModel, noise: NoiseSettings) -> None:
        super().__init__()
        latents = unet.config.out_channels
        widen_input(unet, 2 * latents + 1)
        self.unet = unet
        self.scheduler = noise_scheduler(noise)

    def forward(
        self,
        clean: Float[Tensor, "b c h w"],
        noise: Float[Tensor, "b c h w"],
        level: Float[Tensor, " b"],
        condition: Float[Tensor, "b c h w"],
        mask: Float[Tensor, "b 1 mh mw"],
        sequence: Float[Tensor, "b t d"],
        pooled: Float[Tensor, "b p"],
    ) -> Float[Tensor, " b"]:
        """Denoising loss at timestep `level` (0 … 999). `pooled` is empty here."""
        timestep = level.long()
        noisy, target = training_target(self.scheduler, clean, noise, timestep)
        predicted = self.predict(noisy, timestep, condition, mask, sequence)
        return (predicted.float() - target).square().mean(dim=(1, 2, 3))

    def predict(
        self,
        noisy: Float[Tensor, "b c h w"],
        timestep: Tensor,
        condition: Float[Tensor, "b c h w"],
        mask: Float[Tensor, "b 1 mh mw"],
        sequence: Float[Tensor, "b t d"],
    ) -> Float[Tensor, "b c h w"]:
        """The U-Net's answer: noise or v."""
        size = (noisy.shape[-2], noisy.shape[-1])
        covered = functional.adaptive_avg_pool2d(mask, size)
        channels = torch.cat([noisy, condition, covered], dim=1)
        return self.unet(channels, timestep, encoder_hidden_states=sequence, return_dict=False)[0]

    def draw_level(self, generator: torch.Generator) -> Float[Tensor, ""]:
        """Timestep of one training example."""
        return torch.randint(0, TRAINING_STEPS, (), generator=generator).float()

    def enable_gradient_checkpointing(self) -> None:
        """Recompute activations backward."""
        self.unet.enable_gradient_checkpointing()
