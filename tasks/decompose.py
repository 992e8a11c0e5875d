"""Stage decompose: reference views into ambient and one image per lamp."""

from __future__ import annotations

from luxcore.decompose.stage import decompose_capture
from tasks.context import StageContext


def run(stage: StageContext) -> None:
    """Decompose every capture."""
    for capture in stage.captures:
        metrics = decompose_capture(
            stage.input("capture") / capture,
            stage.input("masks") / capture,
            stage.input("splat") / capture,
            stage.out / capture,
            stage.settings,
            weights=stage.input("train_sv") / "model.safetensors",
            seed=stage.seed,
        )
        stage.log_metrics({f"{capture}_{name}": value for name, value in metrics.items()})
