"""Stage fuse: the exposures of every light merged to linear HDR."""

from __future__ import annotations

from luxcore.capture import load_capture
from luxcore.light.fuse import fuse_capture
from tasks.context import StageContext


def run(stage: StageContext) -> None:
    """Fuse every capture, a unit per view."""
    for name in stage.captures:
        metrics = fuse_capture(
            stage.input("harmonize") / name,
            load_capture(stage.input("capture") / name),
            stage.out / name,
            stage.settings,
            stage.store,
            stage.executor,
        )
        stage.log_metrics({f"{name}.{key}": value for key, value in metrics.items()})
