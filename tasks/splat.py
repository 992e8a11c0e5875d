"""Stage splat: the geometry of every capture, from its photos alone."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from luxcore.capture import Capture, load_capture
from luxcore.files.digests import file_digest
from luxcore.splats.stage1 import fit_geometry
from luxcore.units import unit_key
from tasks.context import StageContext
from tasks.resumable import resumable_unit

_CODE = ("luxcore/splats", "kernels")


def run(stage: StageContext) -> None:
    """One unit per capture."""
    for name in stage.captures:
        capture = load_capture(stage.input("capture") / name)

        def fit(out: Path, checkpoint: Path, capture: Capture = capture) -> None:
            result = fit_geometry(
                capture, out, stage.settings, seed=stage.seed, checkpoint=checkpoint
            )
            stage.log_timing(f"curve_{capture.id}", [asdict(point) for point in result.curve])

        folder = resumable_unit(stage, name, _key(stage, capture), fit)
        _report(stage, name, folder)


def _key(stage: StageContext, capture: Capture) -> str:
    files = [capture.root / "transforms.json", capture.root / "points.ply"]
    inputs = [file_digest(f) for f in (*files, *(f.image_path for f in capture.frames))]
    arguments = {"settings": stage.settings.model_dump(mode="json"), "seed": stage.seed}
    return unit_key(_CODE, arguments, inputs)


def _report(stage: StageContext, name: str, folder: Path) -> None:
    metrics = json.loads((folder / "metrics.json").read_text())
    stage.log_metrics({f"{name}.{key}": value for key, value in metrics.items()})
    for point in json.loads((folder / "curve.json").read_text()):
        stage.log_metric(f"{name}.psnr_heldout", point["psnr_heldout"], step=point["iteration"])
    for picture in sorted((folder / "pictures").glob("*.png")):
        stage.log_picture(f"{name}_{picture.stem}", picture)
