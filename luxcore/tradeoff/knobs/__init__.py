"""The knobs that are swept."""

from __future__ import annotations

from luxcore.tradeoff.knob import Knob
from luxcore.tradeoff.knobs import exposures, models, render, splats

KNOBS: tuple[Knob, ...] = (
    render.SAMPLES,
    splats.ITERATIONS,
    splats.GAUSSIANS,
    splats.HARMONICS,
    splats.CUT_OFF,
    splats.LIGHT_STEPS,
    splats.CACHE,
    exposures.BRACKETS,
    models.PHOTO_SIZE,
    models.VIEWS_PER_PASS,
)

ORDER = tuple(knob.name for knob in KNOBS)
"""Names in the order of the page."""
