"""Stage train_mv: fine-tune the multi-view harmonization model."""

from __future__ import annotations

from luxcore.models.small.training import train_mv
from tasks.context import StageContext


def run(stage: StageContext) -> None:
    """Write the model, its card and its curve; what is handed on is never worse than the base."""
    dataset = stage.input("render") / "train"
    result = train_mv(dataset, stage.out, stage.settings, stage.seed)
    stage.log_metrics(result.metrics)
    for row in result.curve:
        for name in ("loss", "psnr_validation"):
            stage.log_metric(name, row[name], step=int(row["step"]))
    stage.log_picture("validation", result.picture)
