"""The multi-view model on disk, and from a pretrained base."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from luxcore.models.diffusion.base import base_folder, load_component
from luxcore.models.diffusion.exported import read_card, read_exported, write_exported
from luxcore.models.diffusion.text import clip_sequences
from luxcore.models.multiview_unet.unet import MultiViewModule
from luxcore.settings.paper_models import MultiViewSettings

if TYPE_CHECKING:
    from diffusers import AutoencoderKL

MODEL = "multiview-unet"


@dataclass(frozen=True)
class MultiViewModel:
    """The U-Net and the autoencoder that its latents belong to."""

    module: MultiViewModule
    vae: AutoencoderKL

    def files(self) -> dict[str, dict[str, Tensor]]:
        """Trained parameters, and the text embedding that goes with them."""
        return {"unet.safetensors": dict(self.module.state_dict(keep_vars=True))}


def load_base(settings: MultiViewSettings) -> MultiViewModel:
    """A base in SD-2.1's layout, widened and joined across views, on the CPU in float32.

    Raises InputError or FormatError in one sentence when the base is absent or unusable.
    """
    return _assembled(settings, clip_sequences(settings.base, [""])[0])


def save_multiview(folder: Path, model: MultiViewModel, settings: MultiViewSettings) -> None:
    """Write what `open_multiview` needs besides the base's autoencoder and configuration."""
    write_exported(folder, MODEL, settings, model.files())


def open_multiview(folder: Path, base: str) -> MultiViewModel:
    """A trained model on the CPU. `base` replaces the base named in the folder, unless empty."""
    settings = read_card(folder, MODEL, MultiViewSettings)
    if base:
        settings = settings.model_copy(update={"base": base})
    model = _assembled(settings, None)
    read_exported(folder, model.files())
    model.module.requires_grad_(False).eval()
    return model


def _assembled(settings: MultiViewSettings, context: Tensor | None) -> MultiViewModel:
    folder = base_folder(settings.base, ("unet", "vae"))
    from diffusers import AutoencoderKL, UNet2DConditionModel

    unet = load_component(UNet2DConditionModel, folder, "unet", torch.float32)
    vae = load_component(AutoencoderKL, folder, "vae", torch.float32)
    if context is None:
        # Trained weights bring their own; CLIP's length is 77 in every Stable Diffusion.
        context = torch.zeros(77, unet.config.cross_attention_dim)
    return MultiViewModel(MultiViewModule(unet.requires_grad_(True), context, settings), vae)
