"""LoRA in every attention block of the FLUX transformer, stored under diffusers' names."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch import Tensor, nn

if TYPE_CHECKING:
    from diffusers import FluxTransformer2DModel

ATTENTION_LAYERS = (
    "attn.to_q",
    "attn.to_k",
    "attn.to_v",
    "attn.to_out.0",
    "attn.add_q_proj",
    "attn.add_k_proj",
    "attn.add_v_proj",
    "attn.to_add_out",
)
"""The single-stream blocks have only the first three of these."""


def add_lora(transformer: FluxTransformer2DModel, rank: int, single_out: bool, seed: int) -> None:
    """Insert adapters of `rank`, scale 1: normal down-projections from `seed`, zero up-projections.

    `single_out` also adapts the single blocks' output layer (74.7 M parameters on the full base
    rather than 52.3 M). Only the adapters, in float32, are then trainable.
    """
    from peft import LoraConfig

    targets = list(ATTENTION_LAYERS)
    if single_out:
        # By full name: the plain suffix would also adapt the transformer's own last layer.
        blocks = range(len(transformer.single_transformer_blocks))
        targets += [f"single_transformer_blocks.{i}.proj_out" for i in blocks]
    transformer.requires_grad_(False)
    transformer.add_adapter(LoraConfig(r=rank, lora_alpha=rank, target_modules=targets))
    generator = torch.Generator().manual_seed(seed)
    for name, parameter in sorted(lora_parameters(transformer).items()):
        parameter.data = parameter.data.float()
        if ".lora_A." in name:
            start = torch.randn(parameter.shape, generator=generator) / rank
            parameter.data.copy_(start)
        else:
            nn.init.zeros_(parameter)


def lora_parameters(transformer: FluxTransformer2DModel) -> dict[str, Tensor]:
    """The adapters by the names that diffusers' `load_lora_weights` reads."""
    return {
        "transformer." + name.replace(".default.", "."): parameter
        for name, parameter in transformer.named_parameters()
        if ".lora_" in name
    }
