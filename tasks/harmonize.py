"""Stage harmonize: the decomposition carried to every view."""

from __future__ import annotations

from luxcore.harmonize.stage import harmonize_capture
from tasks.context import StageContext


def run(stage: StageContext) -> None:
    """Harmonize every capture, pass by pass."""
    for capture in stage.captures:
        metrics = harmonize_capture(
            stage.input("capture") / capture,
            stage.input("masks") / capture,
            stage.input("splat") / capture,
            stage.input("decompose") / capture,
            stage.out / capture,
            stage.settings,
            stage.store,
            weights=stage.input("train_mv") / "model.safetensors",
            seed=stage.seed,
        )
        stage.log_metrics({f"{capture}_{name}": value for name, value in metrics.items()})
