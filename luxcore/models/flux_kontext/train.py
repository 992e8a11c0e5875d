"""Train the single-view model: `accelerate launch -m luxcore.models.flux_kontext.train`."""

from __future__ import annotations

import sys
from pathlib import Path

from luxcore.models.diffusion.command import train_command
from luxcore.models.diffusion.events import Listener
from luxcore.settings.paper_models import KontextTraining

FROZEN_DTYPE = {"no": "float32", "bf16": "bfloat16", "fp16": "float16"}
"""What is not trained is kept in the precision of the forward pass."""


def train_kontext(settings: KontextTraining, out: Path, listener: Listener) -> Path:
    """Train the paper's single-view model, or go on from the newest checkpoint in the folder."""
    import torch
    from accelerate import PartialState

    from luxcore.models.diffusion.loop import train
    from luxcore.models.diffusion.options import training_digest
    from luxcore.models.diffusion.rooms import open_photos
    from luxcore.models.flux_kontext.editor import encode_prompts, load_editor
    from luxcore.models.flux_kontext.embeddings import cached_embeddings
    from luxcore.models.flux_kontext.examples import EditExamples
    from luxcore.models.flux_kontext.trainee import KontextTrainee
    from luxcore.models.flux_kontext.weights_folder import PROMPTS_FILE

    seed = settings.loop.seed
    examples = EditExamples(open_photos(settings.data, seed), settings.data, seed)
    out.mkdir(parents=True, exist_ok=True)
    with PartialState().main_process_first():
        embeddings = cached_embeddings(out / PROMPTS_FILE, lambda: encode_prompts(settings.model))
    dtype = getattr(torch, FROZEN_DTYPE[settings.loop.mixed_precision])
    editor = load_editor(settings.model, dtype, seed)
    if settings.loop.gradient_checkpointing:
        editor.module.enable_gradient_checkpointing()
    trainee = KontextTrainee(editor, embeddings, examples, settings)
    return train(trainee, settings.phases, settings.loop, out, training_digest(settings), listener)


def main() -> None:
    """The command line."""
    sys.exit(
        train_command(
            "luxcore.models.flux_kontext.train", KontextTraining, train_kontext, sys.argv[1:]
        )
    )


if __name__ == "__main__":
    main()
