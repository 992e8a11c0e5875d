"""A photo, a mask and an instruction to an edited photo: the three variants behind one protocol."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, assert_never, runtime_checkable

import torch
from jaxtyping import Float
from torch import Tensor

from luxcore.models.diffusion.base import base_folder, load_component
from luxcore.models.diffusion.latents import decode, encode
from luxcore.models.flux_kontext.embeddings import (
    PromptEmbeddings,
    encode_flux_prompts,
    encode_sd_prompts,
)
from luxcore.models.flux_kontext.latent_unet import LatentUNetModule
from luxcore.models.flux_kontext.lora import add_lora, lora_parameters
from luxcore.models.flux_kontext.mask import PATCH
from luxcore.models.flux_kontext.prompts import Prompt
from luxcore.models.flux_kontext.transformer import KontextModule
from luxcore.settings.paper_models import KontextSampling, KontextSettings

if TYPE_CHECKING:
    from diffusers import AutoencoderKL, FlowMatchEulerDiscreteScheduler, FluxKontextPipeline


@runtime_checkable
class Editor(Protocol):
    """A single-view model, ready to train or to edit."""

    @property
    def module(self) -> KontextModule | LatentUNetModule: ...

    @property
    def vae(self) -> AutoencoderKL: ...

    @property
    def multiple(self) -> int:
        """Sides of a picture are multiples of this."""
        ...

    def mask_input(self, mask: Float[Tensor, "b 1 h w"]) -> Tensor:
        """The mask as the module takes it."""
        ...

    def edit(
        self,
        photo: Float[Tensor, "1 3 h w"],
        mask: Float[Tensor, "1 1 h w"],
        prompt: Prompt,
        embeddings: PromptEmbeddings,
        sampling: KontextSampling,
        seed: int,
    ) -> Float[Tensor, "1 3 h w"]:
        """The edited display picture. Same arguments, same bits on the same device."""
        ...

    def files(self) -> dict[str, dict[str, Tensor]]:
        """Trained parameters by file and name."""
        ...


@dataclass
class KontextEditor:
    """FLUX.1 Kontext with LoRA, the mask added to its tokens or appended to them."""

    module: KontextModule
    vae: AutoencoderKL
    scheduler: FlowMatchEulerDiscreteScheduler
    multiple: int = PATCH

    def mask_input(self, mask: Float[Tensor, "b 1 h w"]) -> Tensor:
        if self.module.mask_tokens is not None:
            return mask
        return encode(self.vae, mask.expand(-1, 3, -1, -1))

    @torch.no_grad()
    def edit(
        self,
        photo: Float[Tensor, "1 3 h w"],
        mask: Float[Tensor, "1 1 h w"],
        prompt: Prompt,
        embeddings: PromptEmbeddings,
        sampling: KontextSampling,
        seed: int,
    ) -> Float[Tensor, "1 3 h w"]:
        height, width = photo.shape[-2:]
        device, dtype = self.vae.device, self.vae.dtype
        sequence, pooled = embeddings.batch([prompt])
        with self.module.mask_in_force(self.mask_input(mask.to(device))):
            return self._pipeline()(
                image=photo,
                prompt_embeds=sequence.to(device, dtype),
                pooled_prompt_embeds=pooled.to(device, dtype),
                height=height,
                width=width,
                num_inference_steps=sampling.steps,
                guidance_scale=sampling.guidance,
                # On the CPU, so that the noise is the same on every device.
                generator=torch.Generator().manual_seed(seed),
                output_type="pt",
                max_area=height * width,
                _auto_resize=False,
            ).images.float()

    def files(self) -> dict[str, dict[str, Tensor]]:
        files: dict[str, dict[str, Tensor]] = {
            "lora.safetensors": lora_parameters(self.module.transformer)
        }
        if self.module.mask_tokens is not None:
            files["mask.safetensors"] = dict(self.module.mask_tokens.named_parameters())
        return files

    def _pipeline(self) -> FluxKontextPipeline:
        from diffusers import FluxKontextPipeline

        pipeline = FluxKontextPipeline(
            scheduler=self.scheduler,
            vae=self.vae,
            text_encoder=None,
            tokenizer=None,
            text_encoder_2=None,
            tokenizer_2=None,
            transformer=self.module.transformer,
        )
        pipeline.set_progress_bar_config(disable=True)
        return pipeline


@dataclass
class LatentUNetEditor:
    """The `sd` variant."""

    module: LatentUNetModule
    vae: AutoencoderKL
    multiple: int = 64

    def mask_input(self, mask: Float[Tensor, "b 1 h w"]) -> Tensor:
        return mask

    @torch.no_grad()
    def edit(
        self,
        photo: Float[Tensor, "1 3 h w"],
        mask: Float[Tensor, "1 1 h w"],
        prompt: Prompt,
        embeddings: PromptEmbeddings,
        sampling: KontextSampling,
        seed: int,
    ) -> Float[Tensor, "1 3 h w"]:
        device = self.vae.device
        sequence = embeddings.batch([prompt])[0].to(device, torch.float32)
        condition = encode(self.vae, photo)
        latents = torch.randn(condition.shape, generator=torch.Generator().manual_seed(seed))
        latents = latents.to(device)
        scheduler = self.module.scheduler
        scheduler.set_timesteps(sampling.steps)
        for timestep in scheduler.timesteps:
            out = self.module.predict(latents, timestep, condition, mask.to(device), sequence)
            latents = scheduler.step(out, timestep, latents).prev_sample
        return decode(self.vae, latents)

    def files(self) -> dict[str, dict[str, Tensor]]:
        return {"unet.safetensors": dict(self.module.unet.named_parameters())}


def load_editor(settings: KontextSettings, dtype: torch.dtype, seed: int) -> Editor:
    """A base with fresh adapters, on the CPU; the frozen parts in `dtype`.

    Raises InputError or FormatError in one sentence when the base is absent or unusable.
    """
    match settings.variant:
        case "mask-add" | "token":
            return _load_kontext(settings, dtype, seed)
        case "sd":
            return _load_sd(settings)
        case _:
            assert_never(settings.variant)


def encode_prompts(settings: KontextSettings) -> PromptEmbeddings:
    """The embeddings of every instruction, from the base's text encoders."""
    if settings.variant == "sd":
        return encode_sd_prompts(settings.base)
    return encode_flux_prompts(settings.base, settings.prompt_tokens)


def _load_kontext(settings: KontextSettings, dtype: torch.dtype, seed: int) -> KontextEditor:
    folder = base_folder(settings.base, ("transformer", "vae", "scheduler"))
    from diffusers import AutoencoderKL, FlowMatchEulerDiscreteScheduler, FluxTransformer2DModel

    transformer = load_component(FluxTransformer2DModel, folder, "transformer", dtype)
    add_lora(transformer, settings.lora_rank, settings.lora_single_out, seed)
    scheduler = FlowMatchEulerDiscreteScheduler.from_pretrained(
        folder / "scheduler", local_files_only=True
    )
    adds_mask = settings.variant == "mask-add"
    module = KontextModule(transformer, adds_mask, settings.training_guidance)
    return KontextEditor(module, load_component(AutoencoderKL, folder, "vae", dtype), scheduler)


def _load_sd(settings: KontextSettings) -> LatentUNetEditor:
    folder = base_folder(settings.base, ("unet", "vae"))
    from diffusers import AutoencoderKL, UNet2DConditionModel

    unet = load_component(UNet2DConditionModel, folder, "unet", torch.float32)
    module = LatentUNetModule(unet.requires_grad_(True), settings.noise)
    return LatentUNetEditor(module, load_component(AutoencoderKL, folder, "vae", torch.float32))
