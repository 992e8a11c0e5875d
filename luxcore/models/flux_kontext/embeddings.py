"""Prompt embeddings, computed once and kept: the text encoders are not in memory at run time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from luxcore.errors import InputError
from luxcore.models.diffusion.base import base_folder, load_component
from luxcore.models.diffusion.device import pick_device
from luxcore.models.diffusion.text import clip_sequences
from luxcore.models.diffusion.weights import read_weights, write_weights
from luxcore.models.flux_kontext.prompts import Prompt, all_prompts

FLUX_TEXT_PARTS = ("text_encoder", "text_encoder_2", "tokenizer", "tokenizer_2")


@dataclass(frozen=True)
class PromptEmbeddings:
    """Per instruction the token sequence [t, d] and the pooled vector [p] (empty for SD)."""

    sequence: dict[str, Tensor]
    pooled: dict[str, Tensor]

    def batch(
        self, prompts: Sequence[Prompt]
    ) -> tuple[Float[Tensor, "b t d"], Float[Tensor, "b p"]]:
        """Stacked embeddings. Raises InputError for an instruction that was not encoded."""
        unknown = [p.text for p in prompts if p.text not in self.sequence]
        if unknown:
            raise InputError(f'no embedding is kept for the instruction "{unknown[0]}".')
        texts = [p.text for p in prompts]
        sequence = torch.stack([self.sequence[text] for text in texts])
        return sequence, torch.stack([self.pooled[text] for text in texts])

    def save(self, path: Path) -> None:
        """One safetensors file; the instruction is part of the tensor's name."""
        named = {f"sequence/{text}": value for text, value in self.sequence.items()}
        named |= {f"pooled/{text}": value for text, value in self.pooled.items()}
        write_weights(path, named)


def load_embeddings(path: Path) -> PromptEmbeddings:
    """The inverse of `save`. Raises InputError when the instructions are not today's."""
    tensors = read_weights(path)
    parts: dict[str, dict[str, Tensor]] = {"sequence": {}, "pooled": {}}
    for name, value in tensors.items():
        part, _, text = name.partition("/")
        parts.setdefault(part, {})[text] = value
    wanted = {prompt.text for prompt in all_prompts()}
    if parts.keys() != {"sequence", "pooled"} or any(set(p) != wanted for p in parts.values()):
        raise InputError(f"{path} holds the embeddings of other instructions: encode them anew.")
    return PromptEmbeddings(parts["sequence"], parts["pooled"])


def cached_embeddings(path: Path, encode: Callable[[], PromptEmbeddings]) -> PromptEmbeddings:
    """Those kept in `path`, or freshly encoded ones, which are then kept there."""
    if not path.exists():
        encode().save(path)
    return load_embeddings(path)


@torch.no_grad()
def encode_flux_prompts(base: str, tokens: int) -> PromptEmbeddings:
    """Every instruction through the base's CLIP (pooled) and T5 (sequence of `tokens`)."""
    folder = base_folder(base, FLUX_TEXT_PARTS)
    from diffusers import FluxKontextPipeline
    from transformers import AutoTokenizer, CLIPTextModel, T5EncoderModel

    pipeline = FluxKontextPipeline(
        scheduler=None,
        vae=None,
        text_encoder=load_component(CLIPTextModel, folder, "text_encoder", torch.bfloat16),
        tokenizer=AutoTokenizer.from_pretrained(folder / "tokenizer", local_files_only=True),
        text_encoder_2=load_component(T5EncoderModel, folder, "text_encoder_2", torch.bfloat16),
        tokenizer_2=AutoTokenizer.from_pretrained(folder / "tokenizer_2", local_files_only=True),
        transformer=None,
    )
    pipeline.to(pick_device("auto"))
    texts = [prompt.text for prompt in all_prompts()]
    sequence, pooled, _ = pipeline.encode_prompt(texts, None, max_sequence_length=tokens)
    return _by_text(texts, sequence.cpu(), pooled.cpu())


@torch.no_grad()
def encode_sd_prompts(base: str) -> PromptEmbeddings:
    """Every instruction through the base's CLIP; Stable Diffusion has no pooled vector."""
    texts = [prompt.text for prompt in all_prompts()]
    return _by_text(texts, clip_sequences(base, texts), torch.zeros(len(texts), 0))


def _by_text(
    texts: Sequence[str], sequence: Float[Tensor, "b t d"], pooled: Float[Tensor, "b p"]
) -> PromptEmbeddings:
    return PromptEmbeddings(
        dict(zip(texts, sequence, strict=True)), dict(zip(texts, pooled, strict=True))
    )
