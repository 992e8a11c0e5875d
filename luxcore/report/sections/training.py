"""Learning curves of both models."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from luxcore.report.content import Section, Strip
from luxcore.report.gallery import Gallery
from luxcore.report.sources import read_json

MODELS = {"sv": "single-view decomposition", "mv": "multi-view harmonization"}


def chapter(artifacts: Path, gallery: Gallery, facts: dict[str, Any]) -> Section | None:
    """One plot per model and per quantity that its curve records."""
    strips = []
    for short, title in MODELS.items():
        stage = f"train_{short}"
        for folder in (artifacts / stage, artifacts / "models" / short):
            points = read_json(folder / "curve.json")
            if points:
                strips.append(_plots(stage, short, title, points, gallery))
    if not strips:
        return None
    intro = "Training of this run, from the shipped weights on."
    return Section("Learning curves", "training", intro, tuple(strips))


def _plots(
    stage: str, short: str, title: str, points: list[dict[str, Any]], gallery: Gallery
) -> Strip:
    axis = next((a for a in ("step", "iteration") if a in points[0]), None)
    names = sorted(
        {k for p in points for k, v in p.items() if isinstance(v, (int, float)) and k != axis}
        - {"seconds"}
    )
    pictures = []
    for name in names:
        kept = [(p[axis] if axis else i, p[name]) for i, p in enumerate(points) if name in p]
        series = {name: ([x for x, _ in kept], [y for _, y in kept])}
        picture = gallery.curves(f"{stage}-{name}", series, ("step", name.replace("_", " ")), name)
        pictures.append(picture)
    return Strip(f"{short.upper()}: {title}", stage, tuple(pictures), columns=2)
