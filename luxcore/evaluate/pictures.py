"""Side-by-side pictures of cases: what the photo shows, what the model says, what is true."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from luxcore.evaluate.cases import LampCase
from luxcore.evaluate.single import decomposed, lamp_of
from luxcore.light.agx import agx
from luxcore.metrics.score import shown_scale
from luxcore.models.interface import Decomposer

MAX_ROWS = 8


def comparison_sheet(
    cases: Sequence[LampCase], decomposer: Decomposer, seed: int = 0
) -> Float[np.ndarray, "h w 3"]:
    """One row per case: photo, mask, model (photo alone), model (geometry), truth; evenly drawn."""
    step = max(1, len(cases) // MAX_ROWS)
    return np.concatenate([_row(case, decomposer, seed) for case in cases[::step][:MAX_ROWS]])


def _row(case: LampCase, decomposer: Decomposer, seed: int) -> np.ndarray:
    exposure = np.float32(case.crop.exposure)

    def predicted(geometry: bool) -> np.ndarray:
        light = lamp_of(decomposed(case, decomposer, seed, geometry=geometry), case.lamp)
        return agx(light * shown_scale(light, case.truth, case.crop.exposure) * exposure)

    mask = np.repeat(case.crop.masks[case.lamp][..., None], 3, axis=2).astype(np.float32)
    photo = agx(case.crop.image_linear * exposure)
    pictures = [photo, mask, predicted(False), predicted(True), agx(case.truth * exposure)]
    return np.concatenate(pictures, axis=1).astype(np.float32)
