"""The multi-view U-Net: Stable Diffusion 2.1's, with more input channels and joint attention."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from luxcore.models.diffusion.noise import TRAINING_STEPS, noise_scheduler, training_target
from luxcore.models.diffusion.widen import widen_input
from luxcore.models.multiview_unet.attention import attend_across_views
from luxcore.models.multiview_unet.condition import MV_CHANNELS, Condition
from luxcore.settings.paper_models import MultiViewSettings

if TYPE_CHECKING:
    from diffusers import DDIMScheduler, UNet2DConditionModel


class MultiViewModule(nn.Module):
    """All parameters are trained. `context` [t, d] is the text embedding of an empty prompt."""

    context: Tensor

    def __init__(
        self,
        unet: UNet2DConditionModel,
        context: Float[Tensor, "t d"],
        settings: MultiViewSettings,
    ) -> None:
        super().__init__()
        self.edits = settings.variant == "mv-edit"
        self.noise = settings.noise
        widen_input(unet, MV_CHANNELS + (1 if self.edits else 0))
        attend_across_views(unet, settings.joint_channels_min)
        self.unet = unet
        self.register_buffer("context", context)

    def forward(
        self,
        clean: Float[Tensor, "b v 4 h w"],
        noise: Float[Tensor, "b v 4 h w"],
        level: Float[Tensor, " b"],
        photo: Float[Tensor, "b v 4 h w"],
        is_reference: Bool[Tensor, "b v"],
        rays: Float[Tensor, "b v 6 h w"],
        task: Float[Tensor, " b"],
        present: Bool[Tensor, "b v"],
        light_mask: Float[Tensor, "b v 1 h w"] | None = None,
    ) -> Float[Tensor, " b"]:
        """Denoising loss over the views that are present and no references.

        `level` is the timestep (0 … 999), one per scene: all views of a scene are equally noisy.
        A reference's lit picture is its own clean one.
        """
        timestep = level.long()
        scheduler = self.scheduler(clean.shape[1])
        noisy, target = training_target(scheduler, clean, noise, timestep)
        condition = Condition(photo, clean, is_reference, rays, task, present, light_mask)
        predicted = self.predict(noisy, timestep, condition)
        error = (predicted.float() - target).square().mean(dim=(2, 3, 4))  # [b, v]
        counted = (present & ~is_reference).to(error.dtype)
        return (error * counted).sum(dim=1) / counted.sum(dim=1).clamp_min(1)

    def predict(
        self, noisy: Float[Tensor, "b v 4 h w"], timestep: Tensor, condition: Condition
    ) -> Float[Tensor, "b v 4 h w"]:
        """The U-Net's answer (noise or v) for every view; for padding it means nothing."""
        b, v = noisy.shape[:2]
        channels = torch.cat([noisy, condition.channels()], dim=2).flatten(0, 1)
        context = self.context.to(channels.dtype).expand(b * v, -1, -1)
        answer = self.unet(
            channels,
            timestep.expand(b).repeat_interleave(v),
            encoder_hidden_states=context,
            cross_attention_kwargs={"present": condition.present},
            return_dict=False,
        )[0]
        return answer.unflatten(0, (b, v))

    def scheduler(self, views: int) -> DDIMScheduler:
        """The noise schedule for scenes of that many views."""
        return noise_scheduler(self.noise, views)

    def draw_level(self, generator: torch.Generator) -> Float[Tensor, ""]:
        """Timestep of one training example."""
        return torch.randint(0, TRAINING_STEPS, (), generator=generator).float()
