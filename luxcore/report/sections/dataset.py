"""The training set: a contact sheet and what is in it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from luxcore.files.exr import read_exr
from luxcore.report.content import Picture, Section, Strip, Table, number
from luxcore.report.gallery import Gallery
from luxcore.report.sources import light_names, read_json, spread

VIEWS_SHOWN = 8
SPLIT_SHOWN = 2
SPLITS = ("train", "test")


@dataclass(frozen=True)
class RenderedFile:
    """One rendered view on disk and its metadata."""

    split: str
    name: str
    path: Path
    metadata: dict[str, Any]


def rendered_views(artifacts: Path) -> list[RenderedFile]:
    """Every view of the training and test sets."""
    return [
        RenderedFile(split, path.stem, path.with_suffix(".exr"), read_json(path))
        for split in SPLITS
        for path in sorted((artifacts / "render" / split).glob("*.json"))
        if path.with_suffix(".exr").is_file()
    ]


def chapter(artifacts: Path, gallery: Gallery, facts: dict[str, Any]) -> Section | None:
    """Contact sheet, one view lamp by lamp, and counts."""
    views = rendered_views(artifacts)
    if not views:
        return None
    sheet = tuple(_photo(view, gallery) for view in spread(views, VIEWS_SHOWN))
    blocks: list[Strip | Table] = [
        Strip("Contact sheet", "render", sheet, columns=4, note=f"{len(views)} views in all.")
    ]
    for view in spread(views, SPLIT_SHOWN):
        pictures = _lamps(view, gallery)
        blocks.append(
            Strip(f"{view.split}/{view.name}, lamp by lamp", "render", pictures, columns=4)
        )
    blocks += [_counts(views), _kinds(views)]
    intro = (
        "Rendered rooms that the models learn from. One render per view gives the light of every "
        "lamp apart, so any mix of them is exact."
    )
    return Section("Dataset", "dataset", intro, tuple(blocks))


def _lamps_of(view: RenderedFile) -> list[dict[str, Any]]:
    return list(view.metadata.get("lamps", []))


def _photo(view: RenderedFile, gallery: Gallery) -> Picture:
    layers = read_exr(view.path)
    total = layers["ambient"].copy()
    for name, lamp in zip(light_names(layers), _lamps_of(view), strict=True):
        if lamp["on"]:
            total += np.asarray(lamp["scale"], np.float32) * layers[name]
    exposure = float(view.metadata.get("exposure", 1.0))
    lit = sum(lamp["on"] for lamp in _lamps_of(view))
    caption = f"{view.split}/{view.name}: {lit} of {len(_lamps_of(view))} lamps on"
    return gallery.linear(f"dataset-{view.split}-{view.name}", total, exposure, caption)


def _lamps(view: RenderedFile, gallery: Gallery) -> tuple[Picture, ...]:
    layers = read_exr(view.path)
    exposure = float(view.metadata.get("exposure", 1.0))
    prefix = f"dataset-{view.split}-{view.name}"
    pictures = [gallery.linear(f"{prefix}-ambient", layers["ambient"], exposure, "ambient")]
    for name, lamp in zip(light_names(layers), _lamps_of(view), strict=True):
        # Unit white at 1 W is far darker than the lamp in the photo: shown at its own power.
        level = max(lamp["scale"]) or 1.0
        caption = f"{lamp['name']} ({lamp['kind']}, {number(lamp['power_w'])} W)"
        pictures.append(gallery.linear(f"{prefix}-{name}", layers[name] * level, exposure, caption))
    return tuple(pictures)


def _counts(views: list[RenderedFile]) -> Table:
    rows = []
    for split in SPLITS:
        of = [v for v in views if v.split == split]
        if of:
            lamps = [len(_lamps_of(v)) for v in of]
            rows.append(
                (
                    split,
                    str(len({v.metadata.get("room") for v in of})),
                    str(len(of)),
                    f"{min(lamps)} / {np.mean(lamps):.1f} / {max(lamps)}",
                    _values(v.metadata.get("spp") for v in of),
                )
            )
    columns = ("set", "rooms", "views", "lamps a view: least / mean / most", "samples a pixel")
    return Table("What is in it", "render", columns, tuple(rows))


def _kinds(views: list[RenderedFile]) -> Table:
    lamps = {
        (v.split, v.metadata.get("room"), lamp["id"]): lamp for v in views for lamp in _lamps_of(v)
    }
    kinds = Counter(str(lamp["kind"]) for lamp in lamps.values())
    rows = []
    for kind, count in kinds.most_common():
        powers = [float(lamp["power_w"]) for lamp in lamps.values() if lamp["kind"] == kind]
        lit = sum(bool(lamp["on"]) for lamp in lamps.values() if lamp["kind"] == kind)
        rows.append((kind, str(count), str(lit), f"{np.median(powers):.3g}"))
    return Table("Lamps", "render", ("kind", "count", "on", "median power, W"), tuple(rows))


def _values(values: Iterable[Any]) -> str:
    return ", ".join(map(str, sorted({v for v in values if v is not None})))
