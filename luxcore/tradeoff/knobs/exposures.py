"""How many 8-bit exposures a lamp's light is merged from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from luxcore.capture import load_capture
from luxcore.errors import InputError
from luxcore.evaluate.captures import true_view
from luxcore.light.agx import agx
from luxcore.light.exposure import BRACKETS_EV
from luxcore.light.hdr import merge_brackets
from luxcore.masks.store import load_masks
from luxcore.tradeoff.knob import Bench, Choice, Knob, Work, stopwatch

MERGED_EV = {
    "EV 0": (0.0,),
    "EV 0, −4": (0.0, -4.0),
    "EV 0, −2, −4": BRACKETS_EV,
    "EV 0, −1, −2, −3, −4": (0.0, -1.0, -2.0, -3.0, -4.0),
}
VIEWS = 3


@dataclass(frozen=True)
class _Light:
    radiance: np.ndarray
    exposure: float


def _prepare(bench: Bench) -> list[_Light]:
    capture = load_capture(bench.input("capture"))
    if capture.truth is None:
        raise InputError(f"{capture.root} has no known truth to compare exposures with.")
    masks = load_masks(bench.input("masks"))
    lights = []
    for view in range(min(VIEWS, len(capture.frames))):
        truth = true_view(capture, masks, view, capture.frames[view].camera.width)
        lights += [_Light(np.asarray(light, np.float32), truth.exposure) for light in truth.lights]
    return lights


def _run(lights: list[_Light], choice: Choice, repeat: int) -> Work:
    stops = MERGED_EV[choice.label]
    errors = []
    with stopwatch() as watch:
        merged = []
        for light in lights:
            shown = [
                np.round(agx(np.float32(light.exposure * 2.0**ev) * light.radiance) * 255) / 255
                for ev in stops
            ]
            merged.append(merge_brackets(shown, stops, exposure=light.exposure).radiance)
    for light, radiance in zip(lights, merged, strict=True):
        errors.append(np.abs(radiance - light.radiance).sum() / light.radiance.sum())
    return watch.work(float(np.mean(errors)))


BRACKETS = Knob(
    name="exposures merged for each lamp",
    work="a lamp's exposures merged",
    choices=tuple(Choice(label, {}) for label in MERGED_EV),
    error="mean error, share of the lamp's light",
    why="One exposure loses the lamp itself; three hold it, as in the paper, and five cost half as "
    "much again for a fifth less error.",
    prepare=_prepare,
    run=_run,
    fixed_default="EV 0, −2, −4",
)
