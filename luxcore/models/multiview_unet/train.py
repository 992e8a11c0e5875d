"""Train the multi-view model: `accelerate launch -m luxcore.models.multiview_unet.train`."""

from __future__ import annotations

import sys
from pathlib import Path

from luxcore.models.diffusion.command import train_command
from luxcore.models.diffusion.events import Listener
from luxcore.settings.paper_models import MultiViewTraining


def train_multiview(settings: MultiViewTraining, out: Path, listener: Listener) -> Path:
    """Train the paper's multi-view model, or go on from the newest checkpoint in the folder."""
    from luxcore.models.diffusion.loop import train
    from luxcore.models.diffusion.options import training_digest
    from luxcore.models.diffusion.rooms import open_sets
    from luxcore.models.multiview_unet.examples import ViewExamples
    from luxcore.models.multiview_unet.trainee import MultiViewTrainee
    from luxcore.models.multiview_unet.weights_folder import load_base

    seed = settings.loop.seed
    sets = open_sets(settings.data, seed)
    examples = ViewExamples(sets, settings.data, settings.model, seed)
    model = load_base(settings.model)
    if settings.loop.gradient_checkpointing:
        model.module.unet.enable_gradient_checkpointing()
    trainee = MultiViewTrainee(model, examples, settings)
    return train(trainee, settings.phases, settings.loop, out, training_digest(settings), listener)


def main() -> None:
    """The command line."""
    sys.exit(
        train_command(
            "luxcore.models.multiview_unet.train", MultiViewTraining, train_multiview, sys.argv[1:]
        )
    )


if __name__ == "__main__":
    main()
