"""The trained single-view model on disk: adapters or U-Net, mask layer, prompt embeddings."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import torch

from luxcore.models.diffusion.exported import read_card, read_exported, write_exported
from luxcore.models.flux_kontext.editor import Editor, load_editor
from luxcore.models.flux_kontext.embeddings import PromptEmbeddings, load_embeddings
from luxcore.settings.paper_models import KontextSettings

MODEL = "flux-kontext"
PROMPTS_FILE = "prompts.safetensors"


@dataclass(frozen=True)
class TrainedEditor:
    """An editor with trained weights and the embeddings of its instructions."""

    editor: Editor
    embeddings: PromptEmbeddings


def save_editor(
    folder: Path, editor: Editor, embeddings: PromptEmbeddings, settings: KontextSettings
) -> None:
    """Write what `open_editor` needs besides the base; the LoRA in diffusers' own form."""
    write_exported(folder, MODEL, settings, editor.files())
    embeddings.save(folder / PROMPTS_FILE)


def open_editor(folder: Path, base: str, dtype: torch.dtype) -> TrainedEditor:
    """A trained editor on the CPU. `base` replaces the base named in the folder, unless empty.

    Raises InputError when the weights match the base's layers only in part.
    """
    settings = read_card(folder, MODEL, KontextSettings)
    if base:
        settings = settings.model_copy(update={"base": base})
    embeddings = load_embeddings(folder / PROMPTS_FILE)
    editor = load_editor(settings, dtype, seed=0)
    read_exported(folder, editor.files())
    editor.module.requires_grad_(False).eval()
    return TrainedEditor(editor, embeddings)
