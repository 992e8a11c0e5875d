"""Stage evaluate: decomposition, harmonization and relightable scenes against truth."""

from __future__ import annotations

from luxcore.data.compact import list_rendered
from luxcore.evaluate.run import evaluate_models
from luxcore.evaluate.scenes import SceneFolders, evaluate_scenes
from luxcore.files.atomic import write_json
from tasks.context import StageContext


def run(stage: StageContext) -> None:
    """The tables on the rendered test rooms and on every capture with truth."""
    captures = [
        (stage.input("capture") / capture, stage.input("masks") / capture)
        for capture in stage.captures
    ]
    metrics = evaluate_models(
        list_rendered(stage.input("render") / "test"),
        captures,
        stage.out,
        stage.settings,
        sv_weights=stage.input("train_sv") / "model.safetensors",
        mv_weights=stage.input("train_mv") / "model.safetensors",
        seed=stage.seed,
    )
    holdouts = (stage.params.splat.holdout_every, stage.params.relight.holdout_every)
    metrics |= evaluate_scenes(_scenes(stage), stage.out, holdouts)
    stage.log_metrics(metrics)
    write_json(stage.out / "metrics.json", metrics)
    for picture in sorted((stage.out / "pictures").glob("*.png")):
        stage.log_picture(picture.stem, picture)


def _scenes(stage: StageContext) -> list[SceneFolders]:
    return [
        SceneFolders(
            stage.input("capture") / name,
            stage.input("masks") / name,
            stage.input("fuse") / name,
            stage.input("relight") / name,
        )
        for name in stage.captures
    ]
