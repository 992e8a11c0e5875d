"""What the multi-view U-Net is told about the views of a scene."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn import functional

LATENT_CHANNELS = 4
RAY_CHANNELS = 6
MV_CHANNELS = 3 * LATENT_CHANNELS + 1 + RAY_CHANNELS + 1
"""Noisy, photo and reference latents, reference mask, rays, task: 20. `mv-edit` has one more."""


@dataclass(frozen=True)
class Condition:
    """The condition of b scenes of v views, at latent resolution.

    photo: latents of the photos as taken. reference: latents of the lit picture where
    `is_reference`, 0 elsewhere. rays: Plücker coordinates. task: 0 for an OLAT, 1 for one light
    off. present: False for padding. light_mask: the lamp's mask, only for `mv-edit`.
    """

    photo: Float[Tensor, "b v 4 h w"]
    reference: Float[Tensor, "b v 4 h w"]
    is_reference: Bool[Tensor, "b v"]
    rays: Float[Tensor, "b v 6 h w"]
    task: Float[Tensor, " b"]
    present: Bool[Tensor, "b v"]
    light_mask: Float[Tensor, "b v 1 h w"] | None = None

    def channels(self) -> Float[Tensor, "b v c h w"]:
        """Every channel after the noisy latents, in the order of the U-Net's input layer."""
        b, v, _, h, w = self.photo.shape
        flags = self.is_reference.to(self.photo.dtype)[:, :, None, None, None]
        task = self.task.to(self.photo.dtype)[:, None, None, None, None]
        parts = [
            self.photo,
            self.reference * flags,
            flags.expand(b, v, 1, h, w),
            self.rays,
            task.expand(b, v, 1, h, w),
        ]
        if self.light_mask is not None:
            parts.append(self.light_mask)
        return torch.cat(parts, dim=2)

    def emptied(self) -> Condition:
        """Without what says which light is meant: for guidance and its training.

        References and light masks go; photos, rays, task and padding stay.
        """
        mask = None if self.light_mask is None else torch.zeros_like(self.light_mask)
        return replace(
            self,
            reference=torch.zeros_like(self.reference),
            is_reference=torch.zeros_like(self.is_reference),
            light_mask=mask,
        )

    @property
    def is_empty(self) -> bool:
        """Whether nothing says which light is meant."""
        has_mask = self.light_mask is not None and bool(self.light_mask.any())
        return not has_mask and not bool(self.is_reference.any())


def latent_mask(
    mask: Float[Tensor, "b v 1 h w"], size: tuple[int, int]
) -> Float[Tensor, "b v 1 lh lw"]:
    """Covered fraction of each latent's pixels."""
    return functional.adaptive_avg_pool2d(mask.flatten(0, 1), size).unflatten(0, mask.shape[:2])
