"""The FLUX transformer with a lamp's mask, as it is trained: flow matching on latents."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

import torch
from jaxtyping import Float
from torch import Tensor, nn

from luxcore.models.flux_kontext.mask import MaskTokens, mask_added
from luxcore.models.flux_kontext.packing import pack, position_ids

if TYPE_CHECKING:
    from diffusers import FluxTransformer2DModel

SIGMAS = 1000
"""Noise levels that training draws from: 1/1000 … 1, all equally often, as diffusers does."""


class KontextModule(nn.Module):
    """A FLUX Kontext transformer that is shown where the lamp is.

    `adds_mask` takes the mask in pixels through `MaskTokens` (the paper's); otherwise the mask
    comes as latents and is appended as tokens right of the photo's.
    """

    def __init__(
        self, transformer: FluxTransformer2DModel, adds_mask: bool, guidance: float
    ) -> None:
        super().__init__()
        self.transformer = transformer
        self.guidance = guidance
        channels = transformer.config.in_channels
        self.mask_tokens = MaskTokens(channels) if adds_mask else None

    def forward(
        self,
        clean: Float[Tensor, "b c h w"],
        noise: Float[Tensor, "b c h w"],
        level: Float[Tensor, " b"],
        condition: Float[Tensor, "b c h w"],
        mask: Float[Tensor, "b mc mh mw"],
        sequence: Float[Tensor, "b t d"],
        pooled: Float[Tensor, "b p"],
    ) -> Float[Tensor, " b"]:
        """Flow-matching loss: at z = (1 - σ)·clean + σ·noise the answer is noise - clean."""
        sigma = level[:, None, None, None]
        noisy = (1 - sigma) * clean + sigma * noise
        velocity = self.velocity(noisy, level, condition, mask, sequence, pooled)
        return (velocity.float() - pack(noise - clean)).square().mean(dim=(1, 2))

    def velocity(
        self,
        noisy: Float[Tensor, "b c h w"],
        level: Float[Tensor, " b"],
        condition: Float[Tensor, "b c h w"],
        mask: Float[Tensor, "b mc mh mw"],
        sequence: Float[Tensor, "b t d"],
        pooled: Float[Tensor, "b p"],
    ) -> Float[Tensor, "b n k"]:
        """What the transformer predicts for the tokens of the picture that is made."""
        rows, columns = noisy.shape[-2] // 2, noisy.shape[-1] // 2
        made, photo = pack(noisy), pack(condition)
        ids = torch.cat([position_ids(rows, columns, 0), position_ids(rows, columns, 1)])
        has_guidance = self.transformer.config.guidance_embeds
        with self.mask_in_force(mask):
            predicted = self.transformer(
                hidden_states=torch.cat([made, photo], dim=1),
                timestep=level,
                guidance=torch.full_like(level, self.guidance) if has_guidance else None,
                pooled_projections=pooled,
                encoder_hidden_states=sequence,
                txt_ids=torch.zeros(sequence.shape[1], 3, device=noisy.device),
                img_ids=ids.to(noisy.device),
                return_dict=False,
            )[0]
        return predicted[:, : made.shape[1]]

    def mask_in_force(self, mask: Float[Tensor, "b mc mh mw"]) -> AbstractContextManager[None]:
        """The mask, in pixels or as latents, in every call of the transformer within the block."""
        if self.mask_tokens is not None:
            return mask_added(self.transformer, self.mask_tokens(mask), None)
        rows, columns = mask.shape[-2] // 2, mask.shape[-1] // 2
        beside = position_ids(rows, columns, 1, first_column=columns)
        return mask_added(self.transformer, pack(mask), beside)

    def draw_level(self, generator: torch.Generator) -> Float[Tensor, ""]:
        """σ of one training example."""
        return (torch.randint(1, SIGMAS + 1, (), generator=generator) / SIGMAS).float()

    def enable_gradient_checkpointing(self) -> None:
        """Recompute activations backward."""
        self.transformer.enable_gradient_checkpointing()
