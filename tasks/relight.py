"""Stage relight: every lamp's light on the Gaussians of every capture, a relightable scene each."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from luxcore.capture import Capture, load_capture
from luxcore.files.digests import file_digest, tree_digest
from luxcore.splats.stage2 import fit_lights
from luxcore.units import unit_key
from tasks.context import StageContext
from tasks.resumable import resumable_unit

_CODE = ("luxcore/splats", "kernels", "luxcore/light")


def run(stage: StageContext) -> None:
    """One unit per capture."""
    for name in stage.captures:
        capture = load_capture(stage.input("capture") / name)
        inputs = [
            stage.input("splat") / name,
            stage.input("fuse") / name,
            stage.input("masks") / name,
        ]

        def fit(
            out: Path, checkpoint: Path, capture: Capture = capture, inputs: list[Path] = inputs
        ) -> None:
            result = fit_lights(
                capture,
                inputs[0],
                inputs[1],
                inputs[2],
                out,
                stage.settings,
                seed=stage.seed,
                checkpoint=checkpoint,
            )
            stage.log_timing(f"curve_{capture.id}", [asdict(point) for point in result.curve])

        folder = resumable_unit(stage, name, _key(stage, capture, inputs), fit)
        _report(stage, name, folder)


def _key(stage: StageContext, capture: Capture, inputs: list[Path]) -> str:
    splat, fuse, masks = inputs
    digests = [file_digest(splat / "splats.ply"), tree_digest([fuse], fuse)]
    digests += [file_digest(masks / "lamps.json"), file_digest(capture.root / "transforms.json")]
    digests += [file_digest(frame.image_path) for frame in capture.frames]
    arguments = {"settings": stage.settings.model_dump(mode="json"), "seed": stage.seed}
    return unit_key(_CODE, arguments, digests)


def _report(stage: StageContext, name: str, folder: Path) -> None:
    metrics = json.loads((folder / "metrics.json").read_text())
    stage.log_metrics({f"{name}.{key}": value for key, value in metrics.items()})
    for point in json.loads((folder / "curve.json").read_text()):
        stage.log_metric(f"{name}.psnr_lights", point["psnr_lights"], step=point["iteration"])
    for picture in sorted((folder / "thumbnails").glob("*.png")):
        stage.log_picture(f"{name}_{picture.stem}", picture)
