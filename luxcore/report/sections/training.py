"""Learning curves of both models."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from luxcore.report.content import Section, Strip, Table, number
from luxcore.report.gallery import Gallery
from luxcore.report.sources import read_json

AXIS = "step"
COUNTERS = ("seconds", "lamps_seen")
"""What a curve counts beside its steps."""
MODELS = {"sv": "single-view decomposition", "mv": "multi-view harmonization"}


def chapter(artifacts: Path, gallery: Gallery, facts: dict[str, Any]) -> Section | None:
    """One plot per model and per quantity that its curve records."""
    blocks: list[Strip | Table] = []
    for short, title in MODELS.items():
        points = read_json(artifacts / f"train_{short}" / "curve.json")
        if points:
            heading = f"{short.upper()}: {title}"
            shape = _plots if len(points) > 1 else _table
            blocks.append(shape(f"train_{short}", heading, points, gallery))
    if not blocks:
        return None
    intro = "Training of this run, from the shipped weights on."
    return Section("Learning curves", "training", intro, tuple(blocks))


def _plots(stage: str, heading: str, points: list[dict[str, Any]], gallery: Gallery) -> Strip:
    pictures = []
    for name in _quantities(points):
        kept = [(p[AXIS], p[name]) for p in points if name in p]
        series = {name: ([x for x, _ in kept], [y for _, y in kept])}
        picture = gallery.curves(f"{stage}-{name}", series, (AXIS, name.replace("_", " ")), name)
        pictures.append(picture)
    return Strip(heading, stage, tuple(pictures), columns=2)


def _table(stage: str, heading: str, points: list[dict[str, Any]], gallery: Gallery) -> Table:
    """A run too short for a curve: its one measurement."""
    names = (AXIS, *_quantities(points))
    rows = tuple(tuple(number(point[name]) for name in names) for point in points)
    return Table(heading, stage, tuple(name.replace("_", " ") for name in names), rows)


def _quantities(points: list[dict[str, Any]]) -> list[str]:
    return sorted({name for point in points for name in point} - {AXIS, *COUNTERS})
