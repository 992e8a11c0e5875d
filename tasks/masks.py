"""Stage masks: the lamps of every capture, and how well those found agree with the true ones."""

from __future__ import annotations

from luxcore.capture import Capture, load_capture
from luxcore.masks import LampMasks, agreement, find_lamps
from luxcore.masks.find import SHEET
from luxcore.masks.store import Mask
from tasks.context import StageContext


def run(stage: StageContext) -> None:
    """True masks for the rendered room, found ones for the photos."""
    found: dict[str, tuple[Capture, LampMasks]] = {}
    for name in stage.captures:
        capture = load_capture(stage.input("capture") / name)
        masks = find_lamps(capture, stage.out / name, stage.settings)
        found[name] = capture, masks
        stage.log_metric(f"{name}.lamps", len(masks.lamps))
        stage.log_picture(f"{name}_lamps", masks.root / SHEET)
    if {"demo", "demo_photos"} <= set(found):
        score = agreement(_by_photo(*found["demo_photos"]), _by_photo(*found["demo"]))
        stage.log_metric("demo_photos.recall", score.recall)
        stage.log_metric("demo_photos.precision", score.precision)
        stage.log_metric("demo_photos.iou", score.iou)


def _by_photo(capture: Capture, masks: LampMasks) -> list[dict[int, Mask]]:
    """Each lamp's masks by the number in its photo's name, which both captures share."""
    numbers = [int(frame.name.split(".")[0]) for frame in capture.frames]
    return [
        {numbers[v]: mask for v in lamp.areas if (mask := masks.mask(v, lamp.index)) is not None}
        for lamp in masks.lamps
    ]
