"""Per capture: what went in (photos, masks), what came out (every lamp of several views)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from luxcore.report.content import Picture, Section, Strip, Table
from luxcore.report.gallery import Gallery
from luxcore.report.sources import CaptureFiles, find_captures, light_names, spread

VIEWS_SHOWN = 8
VIEWS_SPLIT = 4
"""Views whose lamps are shown one by one."""


def chapter(artifacts: Path, gallery: Gallery, facts: dict[str, Any]) -> Section | None:
    """Photos, masks and the light of every lamp."""
    captures = [c for c in find_captures(artifacts) if c.images]
    blocks = [block for capture in captures for block in _blocks(capture, gallery)]
    if not blocks:
        return None
    intro = (
        "Photos as they came, the pixels that were taken for lamps, and the light of each lamp "
        "alone. Light is linear inside and shown through AgX at the capture's exposure; “put "
        "together” is ambient + Σ scale · lamp and should look like the photo."
    )
    return Section("From photos to lamps", "captures", intro, tuple(blocks))


def _blocks(capture: CaptureFiles, gallery: Gallery) -> list[Strip | Table]:
    views = spread(range(len(capture.images)), VIEWS_SHOWN)
    photos = tuple(
        gallery.display(f"{capture.id}-photo-{v:04d}", capture.photo(v), f"view {v}") for v in views
    )
    note = f"{len(capture.images)} views, source: {capture.about.get('source', 'unknown')}."
    skipped = capture.about.get("skipped") or []
    if skipped:
        reasons = "; ".join(f"{s['name']}: {s['reason']}" for s in skipped)
        note += f" Left out: {reasons}."
    blocks: list[Strip | Table] = [
        Strip(f"{capture.id}: photos", "capture", photos, columns=4, note=note)
    ]
    if capture.lamps:
        blocks += [_lamp_table(capture), _overlays(capture, gallery, views)]
    for view in spread(capture.references, VIEWS_SPLIT):
        blocks += _split(capture, gallery, view)
    return blocks


def _lamp_table(capture: CaptureFiles) -> Table:
    rows = tuple(
        (
            str(lamp["name"]),
            "on" if lamp["on"] else "off",
            str(len(lamp["areas"])),
            ", ".join(map(str, lamp["references"][:4])),
        )
        for lamp in capture.lamps
    )
    columns = ("lamp", "in the photos", "views that see it", "best views")
    return Table(f"{capture.id}: lamps", "masks", columns, rows)


def _overlays(capture: CaptureFiles, gallery: Gallery, views: list[int]) -> Strip:
    pictures = []
    for view in views:
        masks = capture.masks(view)
        names = ", ".join(capture.lamp_name(i) for i in sorted(masks)) or "no lamp"
        caption = f"view {view}: {names}"
        name = f"{capture.id}-masks-{view:04d}"
        pictures.append(gallery.overlay(name, capture.photo(view), masks, caption))
    return Strip(f"{capture.id}: lamp masks", "masks", tuple(pictures), columns=4)


def _split(capture: CaptureFiles, gallery: Gallery, view: int) -> list[Strip | Table]:
    strips: list[Strip | Table] = []
    sources = {"decompose": capture.decomposed(view), "fuse": capture.fused(view)}
    titles = {"decompose": "one view alone", "fuse": "all views agreed, HDR"}
    for stage, layers in sources.items():
        if layers:
            title = f"{capture.id}: view {view}, every lamp ({titles[stage]})"
            pictures = _lamp_pictures(capture, gallery, stage, view, layers)
            strips.append(Strip(title, stage, pictures, columns=len(pictures)))
    return strips


def _lamp_pictures(
    capture: CaptureFiles, gallery: Gallery, stage: str, view: int, layers: dict[str, np.ndarray]
) -> tuple[Picture, ...]:
    prefix = f"{capture.id}-{stage}-{view:04d}"
    g = capture.exposure
    pictures = [
        gallery.display(f"{prefix}-photo", capture.photo(view), "photo"),
        gallery.linear(f"{prefix}-ambient", layers["ambient"], g, "ambient"),
    ]
    for name in light_names(layers):
        label = capture.lamp_name(int(name.split("_")[1]))
        pictures.append(gallery.linear(f"{prefix}-{name}", layers[name], g, label))
    scales = capture.scales(view)
    lights = light_names(layers)
    if scales is not None and len(scales) == len(lights):
        total = layers["ambient"] + sum(
            layers[name] * scale.astype(np.float32)
            for name, scale in zip(lights, scales, strict=True)
        )
        pictures.append(gallery.linear(f"{prefix}-together", total, g, "put together"))
    return tuple(pictures)
