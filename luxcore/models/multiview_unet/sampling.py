"""Sampling all views of a pass together, guided by their references."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from luxcore.models.multiview_unet.condition import Condition
from luxcore.models.multiview_unet.unet import MultiViewModule


@torch.no_grad()
def sample(
    module: MultiViewModule, condition: Condition, steps: int, guidance: float, seed: int
) -> Float[Tensor, "b v 4 h w"]:
    """Clean latents of every view. Same arguments, same bits on the same device.

    Guidance moves the answer away from that of the emptied condition. With guidance 1, or a
    condition that is empty anyway, the second evaluation is left out.
    """
    scheduler = module.scheduler(condition.photo.shape[1])
    scheduler.set_timesteps(steps)
    # On the CPU, so that the noise is the same on every device.
    noise = torch.randn(condition.photo.shape, generator=torch.Generator().manual_seed(seed))
    latents = noise.to(condition.photo)
    guided = guidance != 1 and not condition.is_empty
    empty = condition.emptied()
    for timestep in scheduler.timesteps:
        answer = module.predict(latents, timestep.to(latents.device), condition)
        if guided:
            plain = module.predict(latents, timestep.to(latents.device), empty)
            answer = plain + guidance * (answer - plain)
        latents = scheduler.step(answer, timestep, latents).prev_sample
    return latents
