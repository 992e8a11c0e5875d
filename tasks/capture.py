"""Stage capture: the rendered room with its truth, and the same photos placed by SfM alone."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from luxcore.capture import Capture, from_rendered, ingest, load_capture, pose_error
from luxcore.files.digests import file_digest
from luxcore.units import unit_key
from tasks.context import StageContext
from tasks.resumable import resumable_unit

_CODE = ("luxcore/capture", "luxcore/light")


def run(stage: StageContext) -> None:
    """`demo` has poses and truth from the renderer, `demo_photos` only its photos."""
    demo = from_rendered(stage.input("render") / "demo", stage.out / "demo", stage.settings)
    photos = demo.root / "images"

    def place(out: Path, _: Path) -> None:
        ingest(photos, out, stage.settings, stage.seed, capture_id="demo_photos")

    placed = load_capture(resumable_unit(stage, "demo_photos", _key(stage, photos), place))
    _report(stage, demo, placed)


def _key(stage: StageContext, photos: Path) -> str:
    arguments = {"settings": stage.settings.model_dump(mode="json"), "seed": stage.seed}
    return unit_key(_CODE, arguments, [file_digest(p) for p in sorted(photos.iterdir())])


def _report(stage: StageContext, demo: Capture, placed: Capture) -> None:
    for capture in (demo, placed):
        stage.log_metric(f"{capture.id}.views", len(capture.frames))
        stage.log_metric(f"{capture.id}.points", len(capture.points.xyz))
        stage.log_picture(f"{capture.id}_first_view", capture.frames[0].image_path)
    error = asdict(pose_error(placed, demo))
    stage.log_metrics({f"demo_photos.pose_{name}": value for name, value in error.items()})
