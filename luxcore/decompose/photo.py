"""Decompose one photo with any backend, solve its scale factors, and check that it adds up."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from luxcore.errors import DivergedError
from luxcore.light.agx import agx
from luxcore.light.burning import burning_lamps
from luxcore.metrics.image import psnr
from luxcore.models.interface import Decomposer, Decomposition, Geometry

EXACT_DB = 60.0
"""A recomposed photo that errs by less than its 8 bits do (59 dB) leaves nothing to solve for."""


@dataclass(frozen=True)
class PhotoLight:
    """A decomposed photo. `recomposition_db` is the PSNR of tonemap(ambient + Σ c·OLAT) against
    the photo as displayed (paper, eq. 1)."""

    light: Decomposition
    on: Bool[np.ndarray, " k"]
    recomposition_db: float


def decompose_photo(
    image_linear: Float[np.ndarray, "h w 3"],
    masks: Bool[np.ndarray, "k h w"],
    decomposer: Decomposer,
    *,
    on: Bool[np.ndarray, " k"] | None = None,
    geometry: Geometry | None = None,
    exposure: float = 1.0,
    seed: int = 0,
) -> PhotoLight:
    """Take a photo apart. Radiance in, radiance out; the photo is AgX(exposure · image_linear).

    `on` defaults to what the masks' brightness says. The factors c of burning lamps are solved by
    weighted least squares; lamps that are off keep 0.
    Raises DivergedError when the model's answer is not finite.
    """
    exposed = np.maximum(image_linear, 0).astype(np.float32) * np.float32(exposure)
    burning = burning_lamps(exposed, masks) if on is None else on
    light = decomposer.decompose(exposed, masks, burning, geometry, seed)
    check_finite(light, decomposer.name)
    shown = np.asarray(agx(exposed))
    scale, recomposition = _best_scale(exposed, shown, light, burning)
    light = scaled_by(replace(light, scale=scale), 1 / exposure)
    return PhotoLight(light, burning, recomposition)


def _best_scale(
    exposed: Float[np.ndarray, "h w 3"],
    shown: Float[np.ndarray, "h w 3"],
    light: Decomposition,
    on: Bool[np.ndarray, " k"],
) -> tuple[Float[np.ndarray, "k 3"], float]:
    """RGB factors c of the burning lamps that best rebuild the photo, 0 for the others, and how
    well they do in dB. `shown` is the photo through AgX.

    A model whose lights add up already (the small one) has factors of its own; those stay when
    they rebuild the photo at least as well as the solved ones, or exactly.
    """
    from luxcore.light.scale_factors import solve

    solved = np.zeros((len(on), 3), np.float32)
    if not on.any():
        return solved, _recomposition_db(shown, replace(light, scale=solved))
    own = _recomposition_db(shown, light)
    if own >= EXACT_DB:
        return light.scale, own
    solved[on] = solve(exposed, light.ambient, light.olat[on])
    by_solved = _recomposition_db(shown, replace(light, scale=solved))
    return (solved, by_solved) if by_solved > own else (light.scale, own)


def _recomposition_db(shown: Float[np.ndarray, "h w 3"], light: Decomposition) -> float:
    """PSNR in dB of the recomposed photo through AgX against the photo as shown."""
    return psnr(np.asarray(agx(light.recomposed())), shown)


def scaled_by(light: Decomposition, factor: float) -> Decomposition:
    """The same decomposition in other units of radiance; scales are ratios and stay."""
    if factor == 1:
        return light
    f = np.float32(factor)
    return Decomposition(light.ambient * f, light.olat * f, light.scale)


def check_finite(light: Decomposition, model: str) -> None:
    """Raises DivergedError naming the model when a value is NaN or infinite."""
    for name, values in (("ambient", light.ambient), ("lamp", light.olat), ("scale", light.scale)):
        if not np.isfinite(values).all():
            raise DivergedError(f"model {model} produced {name} light that is not finite.")
