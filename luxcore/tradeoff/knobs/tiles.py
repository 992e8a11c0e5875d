"""A photo decomposed whole, or in overlapping tiles at a finer grid."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from luxcore.decompose.photo import decompose_photo
from luxcore.decompose.stage import backend_settings, reference_views
from luxcore.decompose.views import load_view
from luxcore.models.backends import open_decomposer
from luxcore.models.interface import Decomposer, Geometry, View
from luxcore.tradeoff.knob import Bench, Choice, Knob, Work, stopwatch
from luxcore.tradeoff.knobs.models import ERROR, Truth, trained_weights

OVERLAP = 0.25
"""Share of a tile that its neighbour sees too."""


@dataclass(frozen=True)
class _Prepared:
    truth: Truth
    decomposer: Decomposer
    views: dict[int, View]


def _prepare(bench: Bench) -> _Prepared:
    truth, settings = Truth.of(bench), bench.params.decompose
    backend = backend_settings(settings, trained_weights(bench, "train_sv"))
    references = reference_views(truth.masks.lamps, settings.references_per_lamp)
    splat = bench.input("splat")
    views = {
        view: load_view(truth.capture, truth.masks, splat, view)
        for view in sorted({view for chosen in references for view in chosen})
    }
    return _Prepared(truth, open_decomposer(settings.backend, backend), views)


def _run(prepared: _Prepared, choice: Choice, repeat: int) -> Work:
    side = int(choice.label[0])
    found = []
    with stopwatch() as watch:
        for number, view in prepared.views.items():
            found.append((number, _tiled(prepared.decomposer, view, side)))
    return watch.work(prepared.truth.error(found))


def _tiled(decomposer: Decomposer, view: View, side: int) -> dict[str, np.ndarray]:
    """`side`² tiles, blended linearly where they overlap."""
    size = view.image_linear.shape[:2]
    total = np.zeros((len(view.masks), *size, 3), np.float32)
    weight = np.zeros((*size, 1), np.float32)
    for rows in _spans(size[0], side):
        for columns in _spans(size[1], side):
            part = _cut(view, rows, columns)
            known = part.masks.any((1, 2))
            light = decompose_photo(
                part.image_linear, part.masks, decomposer, on=part.on & known,
                geometry=part.geometry,
            ).light  # fmt: skip
            ramp = _ramp(rows)[:, None] * _ramp(columns)[None, :]
            total[:, rows, columns] += ramp[..., None] * light.contributions()
            weight[rows, columns] += ramp[..., None]
    return {f"light_{k:02d}": image / weight for k, image in enumerate(total)}


def _spans(length: int, count: int) -> Iterator[slice]:
    extent = min(length, round(length / count * (1 + OVERLAP))) if count > 1 else length
    for start in np.linspace(0, length - extent, count).round().astype(int):
        yield slice(int(start), int(start) + extent)


def _ramp(span: slice) -> Float[np.ndarray, " n"]:
    """A weight that falls towards both ends and is never 0."""
    x = (np.arange(span.stop - span.start) + 0.5) / (span.stop - span.start)
    return np.minimum(x, 1 - x).astype(np.float32)


def _cut(view: View, rows: slice, columns: slice) -> View:
    geometry = view.geometry
    if geometry is not None:
        depth, normal = geometry.depth_m[rows, columns], geometry.normal[rows, columns]
        whole = geometry.camera
        camera = replace(
            whole,
            cx=whole.cx - columns.start,
            cy=whole.cy - rows.start,
            width=depth.shape[1],
            height=depth.shape[0],
        )
        geometry = Geometry(camera, depth, normal)
    return View(view.image_linear[rows, columns], view.masks[:, rows, columns], view.on, geometry)


TILES = Knob(
    name="photo whole or in tiles",
    work="references taken apart",
    choices=tuple(Choice(label, {}) for label in ("1 tile", "2 × 2 tiles", "3 × 3 tiles")),
    error=ERROR,
    why="A lamp's light reaches farther than a tile: tiles cost their number and lose the lamps "
    "that lie outside of them, so a photo is always seen whole.",
    prepare=_prepare,
    run=_run,
    fixed_default="1 tile",
)
