"""The end of the chain: relightable scenes beside the rendered truth, in held-out views."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from luxcore.capture import load_capture
from luxcore.data.crops import LitCrop
from luxcore.evaluate.captures import true_view
from luxcore.evaluate.table import Row, flat_metrics, mean_row, write_table
from luxcore.files.exr import read_exr
from luxcore.files.photos import write_png
from luxcore.light.agx import agx
from luxcore.masks.store import load_masks
from luxcore.metrics.score import score_pair
from luxcore.splats.relighting import FixedCamera, solo
from luxcore.splats.scene import load_scene
from luxcore.splats.views import split_views

Image = Float[np.ndarray, "h w 3"]
METHODS = ("relit splats", "harmonized photos", "the photo as it is")
PICTURES = 3
"""Views of each capture that are shown."""


@dataclass(frozen=True)
class SceneFolders:
    """What one capture became."""

    capture: Path
    masks: Path
    fuse: Path
    scene: Path


@dataclass(frozen=True)
class _Case:
    """One light of one held-out view."""

    light: str
    truth: Image
    predictions: tuple[Image, ...]
    exposure: float


def evaluate_scenes(
    scenes: Sequence[SceneFolders], out: Path, holdouts: Sequence[int]
) -> dict[str, float]:
    """Score every capture that has truth; writes tables/scenes.* and pictures/scene_*.png.

    Cases: each lamp alone, and the mix of the photo, in the views that every stage of the splats
    held out; `holdouts` are the stages' `holdout_every`.
    Returns flat metrics; empty where no capture has truth.
    """
    scores: dict[tuple[str, str], list[dict]] = {}
    for folders in scenes:
        views: list[list[_Case]] = []
        for cases in _held_out(folders, holdouts):
            views.append(cases)
            for case in cases:
                kind = "as photographed" if case.light == "photo" else "one lamp"
                for method, predicted in zip(METHODS, case.predictions, strict=True):
                    score = score_pair(predicted, case.truth, case.exposure)
                    scores.setdefault((method, kind), []).append(score)
        if views:
            picture = np.concatenate([_strip(cases) for cases in views[:PICTURES]])
            write_png(out / "pictures" / f"scene_{folders.scene.name}.png", picture)
    rows = [mean_row(method, kind, found) for (method, kind), found in sorted(scores.items())]
    if rows:
        _write(rows, out)
    return {k: round(v, 4) for k, v in flat_metrics("scene", rows).items()}


def _held_out(folders: SceneFolders, holdouts: Sequence[int]) -> Iterator[list[_Case]]:
    capture, masks = load_capture(folders.capture), load_masks(folders.masks)
    if capture.truth is None or any(lamp.truth_light is None for lamp in masks.lamps):
        return
    scene = load_scene(folders.scene)
    for view in seen_by_none(len(capture.frames), holdouts):
        camera = capture.frames[view].camera
        crop = true_view(capture, masks, view, max(camera.width, camera.height))
        yield _cases(crop, FixedCamera(scene, camera), folders.fuse / f"{view:04d}.exr")


def seen_by_none(count: int, holdouts: Sequence[int]) -> list[int]:
    """Of `count` views those that no split with one of these `holdout_every` trains on."""
    held_out = [set(split_views(count, every).held_out) for every in holdouts]
    return sorted(set.intersection(*held_out))


def _cases(crop: LitCrop, camera: FixedCamera, fused_file: Path) -> list[_Case]:
    fused, photo = read_exr(fused_file), crop.image_linear
    lamps = camera.scene.lamps
    cases = [
        _Case(
            lamp.name,
            crop.lights[k],
            (camera.render(solo(camera.scene, lamp.name)), fused[f"light_{k:02d}"], photo),
            crop.exposure,
        )
        for k, lamp in enumerate(lamps)
    ]
    parts = [np.array(lamp.scale) * fused[f"light_{k:02d}"] for k, lamp in enumerate(lamps)]
    mixed = fused["ambient"] + sum(p for p, lamp in zip(parts, lamps, strict=True) if lamp.on)
    return [*cases, _Case("photo", photo, (camera.render(), mixed, photo), crop.exposure)]


def _strip(cases: Sequence[_Case]) -> Image:
    """Truth above prediction, a column per light, as AgX shows them."""
    columns = [
        np.concatenate(
            [agx(image * np.float32(c.exposure)) for image in (c.truth, c.predictions[0])]
        )
        for c in cases
    ]
    return np.concatenate(columns, axis=1)


def _write(rows: Sequence[Row], out: Path) -> None:
    notes = ["Views that neither stage of the splats was trained on; the lamp alone, or the mix."]
    write_table(out / "tables", "scenes", "Relightable scenes, end to end", rows, {}, notes)
