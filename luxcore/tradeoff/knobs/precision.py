"""Cached blending weights stored as half or as float."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from luxcore.light.agx import agx
from luxcore.splats.baked import BakedView, padded_zeros
from luxcore.splats.light_fit import LightFit
from luxcore.tradeoff.knob import Bench, Choice, Knob, Work, stopwatch
from luxcore.tradeoff.knobs.frozen import baked_views, freeze

ROUNDS = 5
"""Passes over all training views in one measurement: a single one is too short to time."""


@dataclass(frozen=True)
class _Prepared:
    fit: LightFit
    stored: dict[str, dict[int, BakedView]]


def _prepare(bench: Bench) -> _Prepared:
    fit = freeze(bench).start(0)
    exact = baked_views(fit.device, fit)
    halved = {view: baked.halved() for view, baked in exact.items()}
    return _Prepared(fit, {"float": exact, "half": halved})


def _pass(fit: LightFit, views: dict[int, BakedView]) -> list[np.ndarray]:
    """Every training view drawn and its gradient gathered, as in a frozen iteration."""
    images, d_lights = [], fit.device.empty(fit.lights.shape)
    for view, baked in views.items():
        shape = fit.views.targets[view].shape
        image = padded_zeros(fit.device, shape[0] * shape[1], shape)
        baked.render(fit.lights, image)
        baked.gather(image, d_lights)
        images.append(image.get())
    return images


def _run(prepared: _Prepared, choice: Choice, repeat: int) -> Work:
    fit = prepared.fit
    with stopwatch() as watch:
        for _ in range(ROUNDS):
            images = _pass(fit, prepared.stored[choice.label])
    exact = _pass(fit, prepared.stored["float"])
    return watch.work(_display_rms(fit, images, exact))


def _display_rms(fit: LightFit, images: list[np.ndarray], exact: list[np.ndarray]) -> float:
    gains = np.repeat(fit.exposure * fit.views.units, 3).astype(np.float32)
    squares = []
    for image, true in zip(images, exact, strict=True):
        shape = (*image.shape[:2], -1, 3)
        shown, target = (agx((gains * i).reshape(shape)) for i in (image, true))
        squares.append(float(np.mean((shown - target) ** 2)))
    return float(np.sqrt(np.mean(squares)))


PRECISION = Knob(
    name="half or float blending weights",
    work="frozen views drawn and gathered",
    choices=(Choice("float", {}), Choice("half", {})),
    error="RMS difference to float, single lamps, display 0..1",
    why="Half takes a quarter of the cache's memory away at an error nobody sees, but a CPU widens "
    "every weight again and takes a quarter longer; float has equal bits with the rasterizer too.",
    prepare=_prepare,
    run=_run,
    fixed_default="float",
)
