"""Pictures to latents of an autoencoder and back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from jaxtyping import Float
from torch import Tensor

if TYPE_CHECKING:
    from diffusers import AutoencoderKL


@torch.no_grad()
def encode(vae: AutoencoderKL, display: Float[Tensor, "b 3 h w"]) -> Float[Tensor, "b c lh lw"]:
    """Scaled latents of display pictures in 0..1: the mode of the posterior, without noise."""
    moments = vae.encode((display * 2 - 1).to(vae.device, vae.dtype)).latent_dist
    shift = getattr(vae.config, "shift_factor", None) or 0.0
    return ((moments.mode() - shift) * vae.config.scaling_factor).float()


@torch.no_grad()
def decode(vae: AutoencoderKL, latents: Float[Tensor, "b c lh lw"]) -> Float[Tensor, "b 3 h w"]:
    """Display pictures in 0..1 of scaled latents."""
    shift = getattr(vae.config, "shift_factor", None) or 0.0
    scaled = latents / vae.config.scaling_factor + shift
    return (vae.decode(scaled.to(vae.device, vae.dtype)).sample.float() / 2 + 0.5).clamp(0, 1)


def latent_scale(vae: AutoencoderKL) -> int:
    """Pixels per latent along one side: 8 for Stable Diffusion and FLUX."""
    return 2 ** (len(vae.config.block_out_channels) - 1)
