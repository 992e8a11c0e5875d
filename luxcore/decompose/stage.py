"""The decompose stage for one capture: reference views into ambient and one image per lamp."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from luxcore.capture import Capture, load_capture
from luxcore.decompose.photo import decompose_photo
from luxcore.decompose.store import write_light
from luxcore.decompose.views import load_view
from luxcore.errors import InputError
from luxcore.files.atomic import write_json
from luxcore.masks.store import Lamp, LampMasks, load_masks
from luxcore.models.backends import open_decomposer
from luxcore.models.interface import BackendSettings, Decomposer
from luxcore.progress import progress
from luxcore.settings.decompose import DecomposeSettings


def decompose_capture(
    capture_dir: Path,
    masks_dir: Path,
    splat_dir: Path | None,
    out: Path,
    settings: DecomposeSettings,
    *,
    weights: Path | None = None,
    seed: int = 0,
) -> dict[str, float]:
    """Decompose the best reference views of each lamp into `out`; returns flat metrics.

    Writes `NNNN/ambient.exr`, `NNNN/light_00.exr` …, `NNNN/lights.json` per reference view and
    `decompose.json`. `weights`: the train_sv stage's model; None takes what the settings name.
    """
    capture, masks = load_capture(capture_dir), load_masks(masks_dir)
    if not masks.lamps:
        raise InputError(f"{masks_dir} names no lamps, so there is nothing to take apart.")
    references = reference_views(masks.lamps, settings.references_per_lamp)
    views = sorted({view for chosen in references for view in chosen})
    decomposer = open_decomposer(settings.backend, backend_settings(settings, weights))
    recomposition = []
    with progress(f"decompose {capture.id}", len(views), "views") as bar:
        for view in views:
            recomposition.append(
                _decompose_view(capture, masks, splat_dir, view, out, settings, decomposer, seed)
            )
            bar.advance(recomposition=f"{recomposition[-1]:.1f} dB")
    write_json(out / "decompose.json", {"references": references, "backend": decomposer.name})
    return {
        "references": float(len(views)),
        "recomposition_db": float(np.mean(recomposition)),
        "recomposition_db_worst": float(np.min(recomposition)),
    }


def reference_views(lamps: Sequence[Lamp], per_lamp: int) -> list[list[int]]:
    """For each lamp its best views, best first; a view already chosen for another lamp serves
    again when it is among the lamp's good ones, so that few views are needed."""
    chosen: list[list[int]] = []
    used: set[int] = set()
    for lamp in lamps:
        order = sorted(lamp.references, key=lambda view: view not in used)[:per_lamp]
        used.update(order)
        chosen.append(order)
    return chosen


def backend_settings(settings: Any, weights: Path | None) -> BackendSettings:
    """What a backend is opened with; a path in the settings goes before the stage's own model."""
    path = settings.weights or (str(weights) if weights is not None else None)
    return BackendSettings(sv_weights=path, mv_weights=path, options=dict(settings.options))


def _decompose_view(
    capture: Capture,
    masks: LampMasks,
    splat_dir: Path | None,
    index: int,
    out: Path,
    settings: DecomposeSettings,
    decomposer: Decomposer,
    seed: int,
) -> float:
    view = load_view(capture, masks, splat_dir if settings.use_geometry else None, index)
    exposure = capture.exposure or 1.0
    known = view.masks.any((1, 2))
    result = decompose_photo(
        view.image_linear / np.float32(exposure),
        view.masks,
        decomposer,
        on=view.on & known,
        geometry=view.geometry,
        exposure=exposure,
        seed=seed,
    )
    names = [lamp.name for lamp in masks.lamps]
    write_light(out / f"{index:04d}", result, names, exposure, known)
    return result.recomposition_db
