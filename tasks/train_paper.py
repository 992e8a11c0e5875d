"""Train one of the paper's models with its curves and pictures in mlflow.

`accelerate launch -m tasks.train_paper flux-kontext --settings FILE --out DIR`. Not a stage of the
DAG: such a run takes days on many GPUs, resumes by itself, and nobody's default run needs it.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from luxcore.models.diffusion.command import train_command
from luxcore.models.diffusion.events import FolderListener
from luxcore.models.flux_kontext.train import train_kontext
from luxcore.models.multiview_unet.train import train_multiview
from luxcore.settings.paper_models import KontextTraining, MultiViewTraining
from tasks.tracking import EXPERIMENT, git_revision, tracking_uri

RUN_FILE = "mlflow_run.txt"
"""Keeps the id of the mlflow run in the output folder: a resumed training goes on in it."""


class MlflowListener:
    """Metrics and pictures to mlflow, and to the output folder beside the checkpoints.

    Nothing is opened before the first report, which only the first device makes.
    """

    def __init__(self, folder: Path) -> None:
        self.files = FolderListener(folder)
        self.run_id: str | None = None

    def metrics(self, step: int, values: Mapping[str, float]) -> None:
        """One batch per report."""
        from mlflow.entities import Metric

        self.files.metrics(step, values)
        now = int(time.time() * 1000)
        batch = [Metric(name, value, now, step) for name, value in values.items()]
        client, run_id = self._run()
        client.log_batch(run_id, batch, synchronous=True)

    def picture(self, step: int, name: str, image: Float[np.ndarray, "h w 3"]) -> None:
        self.files.picture(step, name, image)
        client, run_id = self._run()
        client.log_image(run_id, image.clip(0, 1), f"pictures/{step:08d}_{name}.png")

    def _run(self) -> tuple[Any, str]:
        os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
        from mlflow import MlflowClient

        root = Path(__file__).parents[1]
        client = MlflowClient(tracking_uri(root))
        kept = self.files.folder / RUN_FILE
        if self.run_id is None and kept.is_file():
            self.run_id = kept.read_text(encoding="utf-8").strip()
        if self.run_id is None:
            self.run_id = _create_run(client, self.files.folder.name, git_revision(root))
            kept.write_text(self.run_id, encoding="utf-8")
        return client, self.run_id


def _create_run(client: Any, name: str, revision: str) -> str:
    experiment = client.get_experiment_by_name(EXPERIMENT)
    number = experiment.experiment_id if experiment else client.create_experiment(EXPERIMENT)
    run = client.create_run(number, run_name=name, tags={"git_revision": revision})
    return str(run.info.run_id)


def main(arguments: list[str]) -> int:
    """`MODEL --settings FILE --out DIR`. Returns the exit status."""
    model, rest = (arguments[0], arguments[1:]) if arguments else ("", [])
    name = f"tasks.train_paper {model}"
    match model:
        case "flux-kontext":
            return train_command(name, KontextTraining, train_kontext, rest, MlflowListener)
        case "multiview-unet":
            return train_command(name, MultiViewTraining, train_multiview, rest, MlflowListener)
        case _:
            print("give a model: flux-kontext or multiview-unet.", file=sys.stderr)
            return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
