"""The noise schedule of the U-Net models: Stable Diffusion's, shifted and ended in pure noise.

Sampling is diffusers' DDIM; only the table of betas is ours.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import torch
from jaxtyping import Float, Int
from torch import Tensor

from luxcore.settings.paper_models import NoiseSettings

if TYPE_CHECKING:
    from diffusers import DDIMScheduler

TRAINING_STEPS = 1000
"""Length of Stable Diffusion's schedule; timesteps are 0 (least noise) to 999."""


def alphas_cumprod(settings: NoiseSettings, views: int) -> Float[Tensor, " t"]:
    """Fraction of signal power at each timestep, float64, falling.

    The log-SNR is lowered by log(views): the more views share a content, the more noise it takes
    to hide it (CAT3D, section 3.1). With a zero terminal SNR the last entry is exactly 0
    (Lin et al. 2024, algorithm 1).
    """
    root = torch.linspace(math.sqrt(0.00085), math.sqrt(0.012), TRAINING_STEPS, dtype=torch.float64)
    alphas = torch.cumprod(1 - root**2, dim=0)
    if settings.view_shift:
        alphas = torch.sigmoid(torch.logit(alphas) - math.log(views))
    if settings.zero_terminal_snr:
        signal = alphas.sqrt()
        alphas = ((signal - signal[-1]) * signal[0] / (signal[0] - signal[-1])) ** 2
    return alphas


def noise_scheduler(settings: NoiseSettings, views: int = 1) -> DDIMScheduler:
    """A DDIM scheduler on that schedule; its trailing spacing starts at the last timestep."""
    from diffusers import DDIMScheduler

    alphas = alphas_cumprod(settings, views)
    previous = torch.cat([torch.ones(1, dtype=torch.float64), alphas[:-1]])
    return DDIMScheduler(
        num_train_timesteps=TRAINING_STEPS,
        trained_betas=(1 - alphas / previous).tolist(),
        prediction_type=settings.prediction,
        timestep_spacing="trailing",
        clip_sample=False,
    )


def training_target(
    scheduler: DDIMScheduler,
    clean: Float[Tensor, b * rest],
    noise: Float[Tensor, b * rest],
    timestep: Int[Tensor, " b"],
) -> tuple[Float[Tensor, b * rest], Float[Tensor, b * rest]]:
    """What the U-Net sees at `timestep`, and what it should return there."""
    noisy = scheduler.add_noise(clean, noise, timestep)
    if scheduler.config.prediction_type == "epsilon":
        return noisy, noise
    return noisy, scheduler.get_velocity(clean, noise, timestep)
