"""How large the photos are from which structure from motion finds the cameras."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from luxcore.capture import Capture, ingest, load_capture, pose_error
from luxcore.errors import LuxError
from luxcore.settings.capture import CaptureSettings
from luxcore.tradeoff.knob import Bench, Choice, Knob, Work, stopwatch

LOST = 1.0
"""Error of a capture too few of whose views could be placed."""


@dataclass(frozen=True)
class _Prepared:
    photos: Path
    true: Capture
    spread: float
    scratch: Path
    settings: CaptureSettings


def _prepare(bench: Bench) -> _Prepared:
    true = load_capture(bench.input("capture"))
    photos = bench.scratch / "photos"
    photos.mkdir()
    for frame in true.frames:
        shutil.copyfile(frame.image_path, photos / frame.name)
    centres = np.stack([frame.camera.centre for frame in true.frames])
    spread = float(np.sqrt(((centres - centres.mean(axis=0)) ** 2).sum(axis=1).mean()))
    return _Prepared(photos, true, spread, bench.scratch, bench.params.capture)


def _run(prepared: _Prepared, choice: Choice, repeat: int) -> Work:
    settings = prepared.settings.model_copy(update=choice.section("capture"))
    out = prepared.scratch / "placed"
    shutil.rmtree(out, ignore_errors=True)
    error = LOST
    with stopwatch() as watch:
        try:
            found = ingest(prepared.photos, out, settings, seed=1 + repeat)
        except LuxError:
            found = None
    if found is not None:
        error = pose_error(found, prepared.true).position_rmse / prepared.spread
    return watch.work(error)


SFM_SIZE = Knob(
    name="photo size in structure from motion",
    work="cameras found",
    choices=tuple(
        Choice(f"{n} px", {"capture.image_side": n})
        for n in (160, 240, 480, CaptureSettings().image_side)
    ),
    error="RMS error of camera positions, share of their spread",
    why="Fewer pixels place features less exactly; the default takes most photos at a size where "
    "placing stays a small part of a capture's time. A rendered room (320 pixels wide, so that "
    "larger sides change nothing) is compared with its true cameras, photos with those found at "
    "full size.",
    prepare=_prepare,
    run=_run,
)
