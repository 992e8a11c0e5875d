"""A Lighting Blend Explorer for the best decomposed view of each capture, beside the report."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from luxcore.explorer import write_explorer
from luxcore.report.sources import CaptureFiles, find_captures, light_names, read_json


def write_explorers(artifacts: Path, out: Path) -> list[Path]:
    """Write `out`/blend-ID.html per capture whose lamps were separated; returns the pages."""
    found = (_best_view(capture) for capture in find_captures(Path(artifacts)))
    return [_write(capture, view, out) for capture, view in filter(None, found)]


def _best_view(capture: CaptureFiles) -> tuple[CaptureFiles, int] | None:
    """The decomposed view that is put together best."""
    scored = []
    for view in capture.references:
        lights = read_json(capture.folder("decompose") / f"{view:04d}" / "lights.json")
        if lights:
            scored.append((float(lights.get("recomposition_db", 0.0)), -view))
    return (capture, -max(scored)[1]) if scored else None


def _write(capture: CaptureFiles, view: int, out: Path) -> Path:
    layers, scales = capture.decomposed(view), capture.scales(view)
    lights = read_json(capture.folder("decompose") / f"{view:04d}" / "lights.json")
    assert layers is not None
    assert scales is not None
    names = light_names(layers)
    return write_explorer(
        Path(out) / f"blend-{capture.id}.html",
        capture.photo(view),
        layers["ambient"],
        np.stack([layers[name] for name in names]),
        scales,
        [capture.lamp_name(int(name.split("_")[1])) for name in names],
        float(lights.get("exposure") or capture.exposure),
    )
