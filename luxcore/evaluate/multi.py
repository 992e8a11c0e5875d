"""The multi-view table: one reference view's light carried to the others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from luxcore.data.crops import LitCrop
from luxcore.decompose.photo import decompose_photo
from luxcore.evaluate.cases import radiance_of, view_of
from luxcore.evaluate.consistency import consistency_db, warped
from luxcore.evaluate.table import Row, mean_row
from luxcore.metrics.score import score_pair
from luxcore.models.interface import Decomposer, Decomposition, Harmonizer, Reference
from luxcore.progress import progress

Lights = Float[np.ndarray, "k h w 3"]


@dataclass(frozen=True)
class MultiModels:
    """What is compared, and the seed for models that sample. `harmonizer_unwarped` is the same
    model without warped light, where the backend can do without."""

    decomposer: Decomposer
    harmonizer: Harmonizer
    harmonizer_unwarped: Harmonizer | None
    seed: int = 0


@dataclass(frozen=True)
class MultiResult:
    """Rows of the table and the cross-view consistency of each method, in dB."""

    rows: list[Row]
    consistency_db: dict[str, float]


def multi_table(groups: Sequence[Sequence[LitCrop]], models: MultiModels) -> MultiResult:
    """Scores over all further views of each group; the first view is the reference.

    Only lamps that the reference shows are asked for. "true reference": its light is known, as in
    the paper's task; "predicted reference": it comes from the single-view model.
    """
    methods = _methods(models)
    scores: dict[tuple[str, str], list[dict]] = {key: [] for key in methods}
    agreement: dict[str, list[float]] = {}
    with progress("multi view", len(groups) * len(methods), "runs") as bar:
        for group in groups:
            asked = [k for k, mask in enumerate(group[0].masks) if mask.any()]
            for (name, source), method in methods.items():
                predicted = method(group)
                scores[name, source] += _scored(predicted, group, asked)
                if consistency := _agreement(predicted, group, asked):
                    agreement.setdefault(f"{name}, {source}", []).append(consistency)
                bar.advance()
    rows = [mean_row(name, source, values) for (name, source), values in scores.items()]
    return MultiResult(rows, {name: float(np.mean(v)) for name, v in agreement.items()})


def _methods(models: MultiModels) -> dict[tuple[str, str], Callable]:
    def single(group: Sequence[LitCrop]) -> list[Lights]:
        return [_single(crop, models.decomposer, models.seed) for crop in group[1:]]

    def harmonized(harmonizer: Harmonizer, reference: Callable) -> Callable:
        return lambda group: _harmonized(group, harmonizer, reference(group[0]), models.seed)

    def warp(group: Sequence[LitCrop]) -> list[Lights]:
        return [warped(group[0], group[0].lights, crop) for crop in group[1:]]

    def predicted(crop: LitCrop) -> Reference:
        return _predicted_reference(crop, models.decomposer, models.seed)

    methods = {
        ("SV per view", "no reference"): single,
        ("depth warp alone", "true reference"): warp,
        ("MV", "true reference"): harmonized(models.harmonizer, _true),
        ("MV", "predicted reference"): harmonized(models.harmonizer, predicted),
    }
    if models.harmonizer_unwarped is not None:
        unwarped = harmonized(models.harmonizer_unwarped, _true)
        methods["MV without warp", "true reference"] = unwarped
    return methods


def _single(crop: LitCrop, decomposer: Decomposer, seed: int) -> Lights:
    view = view_of(crop, geometry=True)
    result = decompose_photo(
        radiance_of(crop),
        view.masks,
        decomposer,
        on=view.on,
        geometry=view.geometry,
        exposure=crop.exposure,
        seed=seed,
    )
    return result.light.contributions()


def _harmonized(
    group: Sequence[LitCrop], harmonizer: Harmonizer, reference: Reference, seed: int
) -> list[Lights]:
    views = [view_of(crop, geometry=True) for crop in group[1:]]
    lights = harmonizer.run_pass(views, [reference], seed)
    pairs = zip(lights, group[1:], strict=True)
    return [light.contributions() / np.float32(crop.exposure) for light, crop in pairs]


def _true(crop: LitCrop) -> Reference:
    exposure = np.float32(crop.exposure)
    scale = np.repeat(crop.on[:, None], 3, axis=1).astype(np.float32)
    light = Decomposition(crop.ambient * exposure, crop.lights * exposure, scale)
    return Reference(view_of(crop, geometry=True), light, crop.masks.any((1, 2)))


def _predicted_reference(crop: LitCrop, decomposer: Decomposer, seed: int) -> Reference:
    view = view_of(crop, geometry=True)
    light = decomposer.decompose(view.image_linear, view.masks, view.on, view.geometry, seed)
    return Reference(view, light, view.masks.any((1, 2)))


def _scored(
    predicted: Sequence[Lights], group: Sequence[LitCrop], asked: Sequence[int]
) -> list[dict]:
    return [
        score_pair(lights[k], crop.lights[k], crop.exposure)
        for lights, crop in zip(predicted, group[1:], strict=True)
        for k in asked
    ]


def _agreement(
    predicted: Sequence[Lights], group: Sequence[LitCrop], asked: Sequence[int]
) -> float | None:
    """How well the views' predictions agree where they see the same place; None if nowhere."""
    values = []
    for first in range(len(predicted) - 1):
        source, target = group[1 + first], group[2 + first]
        values += consistency_db(
            replace(source, lights=predicted[first]),
            replace(target, lights=predicted[first + 1]),
            asked,
        )
    return float(np.mean(values)) if values else None
