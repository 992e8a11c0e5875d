"""The knobs that are swept."""

from __future__ import annotations

from luxcore.tradeoff.knob import Knob
from luxcore.tradeoff.knobs import (
    denoiser,
    exposures,
    frozen,
    fusing,
    models,
    photos,
    precision,
    render,
    sampler,
    splats,
    tiles,
)

KNOBS: tuple[Knob, ...] = (
    render.SAMPLES,
    denoiser.DENOISED,
    render.SEPARATE,
    photos.SFM_SIZE,
    splats.ITERATIONS,
    splats.GAUSSIANS,
    splats.HARMONICS,
    splats.CUT_OFF,
    models.PHOTO_SIZE,
    tiles.TILES,
    sampler.STEPS,
    models.VIEWS_PER_PASS,
    models.REFERENCES,
    exposures.BRACKETS,
    fusing.METHOD,
    splats.LIGHT_STEPS,
    frozen.SOLVER,
    splats.CACHE,
    precision.PRECISION,
)
"""In the order of the page; the first knob of a work can turn all of that work's settings."""

ORDER = tuple(knob.name for knob in KNOBS)
