"""The single-view table: lamps on and lamps off in the photo, baselines and the model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from luxcore.decompose.photo import PhotoLight, decompose_photo
from luxcore.evaluate.baselines import BASELINES
from luxcore.evaluate.cases import LampCase, radiance_of, view_of
from luxcore.evaluate.leakage import foreign_energy
from luxcore.evaluate.table import Row, mean_row
from luxcore.metrics.score import score_pair
from luxcore.models.interface import Decomposer
from luxcore.progress import progress

Predict = Callable[[LampCase], Float[np.ndarray, "h w 3"]]


@dataclass(frozen=True)
class SingleResult:
    """Rows of the table, and side numbers of the model's decompositions."""

    rows: list[Row]
    recomposition_db: float
    leakage: float
    """Share of a lamp's energy that falls on other burning lamps' masks."""
    leakage_truth: float


def single_table(
    cases: Sequence[LampCase], decomposer: Decomposer, label: str, seed: int = 0
) -> SingleResult:
    """Scores of every method over `cases`. `label` names the cases: "lamp on" or "lamp off"."""
    methods: dict[str, Predict] = dict(BASELINES)
    kept: dict[int, PhotoLight] = {}

    def model(case: LampCase, geometry: bool) -> Float[np.ndarray, "h w 3"]:
        result = decomposed(case, decomposer, seed, geometry=geometry)
        if not geometry:
            kept[id(case)] = result
        return lamp_of(result, case.lamp)

    methods[f"{decomposer.name}, photo alone"] = lambda case: model(case, False)
    methods[f"{decomposer.name}, geometry given"] = lambda case: model(case, True)
    rows = []
    with progress(f"single view, {label}", len(methods) * len(cases), "photos") as bar:
        for name, predict in methods.items():
            scores = []
            for case in cases:
                scores.append(score_pair(predict(case), case.truth, case.crop.exposure))
                bar.advance()
            rows.append(mean_row(name, label, scores))
    results = [kept[id(case)] for case in cases]
    return SingleResult(
        rows,
        float(np.mean([r.recomposition_db for r in results])),
        _mean_leakage([lamp_of(r, c.lamp) for r, c in zip(results, cases, strict=True)], cases),
        _mean_leakage([case.truth for case in cases], cases),
    )


def decomposed(
    case: LampCase, decomposer: Decomposer, seed: int = 0, *, geometry: bool
) -> PhotoLight:
    """The model's decomposition of a case, in radiance; `seed` is for models that sample."""
    view = view_of(case.crop, geometry=geometry)
    return decompose_photo(
        radiance_of(case.crop),
        view.masks,
        decomposer,
        on=view.on,
        geometry=view.geometry,
        exposure=case.crop.exposure,
        seed=seed,
    )


def lamp_of(result: PhotoLight, lamp: int) -> Float[np.ndarray, "h w 3"]:
    """A lamp's light as the photo has it, or at scale 1 when it is off."""
    scale = result.light.scale[lamp] if result.on[lamp] else np.ones(3, np.float32)
    return result.light.olat[lamp] * scale


def _mean_leakage(lights: Sequence[np.ndarray], cases: Sequence[LampCase]) -> float:
    shares = [
        foreign_energy(light, case.crop.masks, case.crop.on, case.lamp)
        for light, case in zip(lights, cases, strict=True)
    ]
    known = [share for share in shares if share is not None]
    return float(np.mean(known)) if known else 0.0
