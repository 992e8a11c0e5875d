"""The paper's consistency strips: one lamp over many views, each view alone against all agreed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from luxcore.report.content import Picture, Section, Strip
from luxcore.report.gallery import Gallery
from luxcore.report.sources import CaptureFiles, find_captures, spread

VIEWS_SHOWN = 6
LAMPS_SHOWN = 3


def chapter(artifacts: Path, gallery: Gallery, facts: dict[str, Any]) -> Section | None:
    """For each lamp a row per source: single view, all views, and the truth where it is known."""
    strips = [
        strip
        for capture in find_captures(artifacts)
        for lamp in range(min(len(capture.lamps), LAMPS_SHOWN))
        for strip in _rows(capture, gallery, lamp)
    ]
    if not strips:
        return None
    intro = (
        "The same lamp seen from several places. Decomposed one view at a time, its light changes "
        "from view to view; harmonized, it should not. Views that were not decomposed alone stay "
        "out of the first row."
    )
    return Section(
        "Does a lamp look the same from everywhere?", "consistency", intro, tuple(strips)
    )


def _rows(capture: CaptureFiles, gallery: Gallery, lamp: int) -> list[Strip]:
    light = f"light_{lamp:02d}"
    name = capture.lamp_name(lamp)
    sources = {
        "decompose": (capture.decomposed, capture.references, "one view at a time"),
        "fuse": (capture.fused, list(range(len(capture.images))), "all views agreed"),
        "capture": (capture.truth, list(range(len(capture.images))), "truth"),
    }
    strips = []
    for stage, (read, views, label) in sources.items():
        pictures = []
        for view in spread(views, VIEWS_SHOWN):
            layers = read(view)
            if layers and light in layers:
                pictures.append(_picture(capture, gallery, stage, view, light, layers[light]))
        if pictures:
            title = f"{capture.id}: {name}, {label}"
            strips.append(Strip(title, stage, tuple(pictures), columns=VIEWS_SHOWN))
    return strips


def _picture(
    capture: CaptureFiles, gallery: Gallery, stage: str, view: int, light: str, image: np.ndarray
) -> Picture:
    name = f"{capture.id}-consistency-{stage}-{light}-{view:04d}"
    return gallery.linear(name, image, capture.exposure, f"view {view}")
