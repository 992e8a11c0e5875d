"""Text through the CLIP encoder of a Stable Diffusion base."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from luxcore.models.diffusion.base import base_folder, load_component

TEXT_PARTS = ("text_encoder", "tokenizer")


@torch.no_grad()
def clip_sequences(base: str, texts: Sequence[str]) -> Float[Tensor, "b t d"]:
    """Last hidden states of the base's CLIP text encoder, at its full length."""
    folder = base_folder(base, TEXT_PARTS)
    from transformers import AutoTokenizer, CLIPTextModel

    encoder = load_component(CLIPTextModel, folder, "text_encoder", torch.float32)
    tokenizer = AutoTokenizer.from_pretrained(folder / "tokenizer", local_files_only=True)
    tokens = tokenizer(
        list(texts),
        padding="max_length",
        truncation=True,
        max_length=encoder.config.max_position_embeddings,
        return_tensors="pt",
    )
    return encoder(tokens.input_ids)[0]
