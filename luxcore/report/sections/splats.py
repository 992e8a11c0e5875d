"""Gaussians: how fast the geometry was found, what depth it gives, what relighting reached."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from luxcore.files.exr import read_exr
from luxcore.report.content import Section, Strip, Table, number
from luxcore.report.gallery import Gallery
from luxcore.report.sources import CaptureFiles, find_captures, read_json, spread

DEPTHS_SHOWN = 4


@dataclass(frozen=True)
class Curve:
    """Quality against seconds of one stage, as its timings hold it."""

    stage: str
    score: str
    title: str
    axis: str
    caption: str


CURVES = (
    Curve(
        "splat",
        "psnr_heldout",
        "How fast geometry is found",
        "PSNR of held-out views, dB",
        "stage 1, one line a capture: photos that it was not fitted to",
    ),
    Curve(
        "relight",
        "psnr_lights",
        "How fast the lamps' light is found",
        "PSNR of single lamps, held-out, dB",
        "stage 2, one line a capture: against the fused light of views that it was not fitted to",
    ),
)


def chapter(artifacts: Path, gallery: Gallery, facts: dict[str, Any]) -> Section | None:
    """Curves of held-out quality against time, depth maps, metrics and lamp thumbnails."""
    captures = find_captures(artifacts)
    blocks: list[Strip | Table] = []
    for curve in CURVES:
        blocks += _curve(curve, artifacts, captures, gallery)
    for capture in captures:
        blocks += _depths(capture, gallery) + _thumbnails(capture, gallery)
    table = _metrics(captures)
    if table:
        blocks.append(table)
    if not blocks:
        return None
    intro = (
        "Stage 1 finds Gaussians in the light the photos were taken in; stage 2 gives every "
        "Gaussian one HDR colour for the ambient light and one for each lamp."
    )
    return Section("Splats", "splats", intro, tuple(blocks))


def _curve(
    curve: Curve, artifacts: Path, captures: list[CaptureFiles], gallery: Gallery
) -> list[Strip | Table]:
    """One line a capture; seconds are not a stage's output, so they lie with its timings."""
    timings = read_json(artifacts / "timings" / f"{curve.stage}.json") or {}
    series = {}
    for capture in captures:
        points = timings.get(f"curve_{capture.id}") or []
        if points:
            series[capture.id] = (
                [point["seconds"] for point in points],
                [point[curve.score] for point in points],
            )
    if not series:
        return []
    picture = gallery.curves(f"{curve.stage}-curve", series, ("time, s", curve.axis), curve.caption)
    return [Strip(curve.title, curve.stage, (picture,))]


def _depths(capture: CaptureFiles, gallery: Gallery) -> list[Strip | Table]:
    files = sorted((capture.folder("splat") / "depth").glob("*.exr"))
    unit = "metres" if capture.about.get("metric") else "units"
    pictures = tuple(
        gallery.grey(
            f"{capture.id}-depth-{file.stem}",
            read_exr(file)["depth_m"][..., 0],
            f"view {int(file.stem)}, depth in {unit}",
        )
        for file in spread(files, DEPTHS_SHOWN)
    )
    return [Strip(f"{capture.id}: depth", "splat", pictures, columns=4)] if pictures else []


def _thumbnails(capture: CaptureFiles, gallery: Gallery) -> list[Strip | Table]:
    folder = capture.folder("relight")
    scene = read_json(folder / "scene.json") or {}
    pictures = []
    for lamp in scene.get("lamps", []):
        file = folder / "thumbnails" / f"lamp_{lamp['index']}.png"
        if file.is_file():
            pictures.append(gallery.copy(f"{capture.id}-{file.stem}", file, str(lamp["name"])))
    return (
        [Strip(f"{capture.id}: lamps of the scene", "relight", tuple(pictures))] if pictures else []
    )


def _metrics(captures: list[CaptureFiles]) -> Table | None:
    rows = []
    for capture in captures:
        for stage in ("splat", "relight"):
            found = read_json(capture.folder(stage) / "metrics.json") or {}
            rows += [
                (capture.id, stage, name, number(value))
                for name, value in sorted(found.items())
                if isinstance(value, (int, float))
            ]
    columns = ("capture", "stage", "metric", "value")
    return Table("Splat metrics", "relight", columns, tuple(rows)) if rows else None
