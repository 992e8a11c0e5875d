"""How many 8-bit exposures a lamp's light is merged from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from luxcore.capture import load_capture
from luxcore.errors import InputError
from luxcore.files.exr import read_exr
from luxcore.light.agx import agx
from luxcore.light.hdr import merge_brackets
from luxcore.tradeoff.knob import Bench, Choice, Knob, Work, stopwatch

BRACKETS_EV = {
    "EV 0": (0.0,),
    "EV 0, −4": (0.0, -4.0),
    "EV 0, −2, −4": (0.0, -2.0, -4.0),
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
    lights = []
    for path in sorted(capture.truth.glob("[0-9][0-9][0-9][0-9].exr"))[:VIEWS]:
        layers = read_exr(path)
        for name in (n for n in layers if n.startswith("light_")):
            peak = float(np.quantile(layers[name], 0.5))
            # At unit white and 1 W a lamp is dark: exposed as in a photo of it alone.
            lights.append(_Light(layers[name], 0.18 / max(peak, 1e-9)))
    return lights


def _run(lights: list[_Light], choice: Choice, repeat: int) -> Work:
    stops = BRACKETS_EV[choice.label]
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
    choices=tuple(Choice(label, {}) for label in BRACKETS_EV),
    error="mean error, share of the lamp's light",
    why="One exposure loses the lamp itself; three reach 2^6.5 · 16 above middle grey, as in the "
    "paper, and five add time but hardly accuracy.",
    prepare=_prepare,
    run=_run,
    fixed_default="EV 0, −2, −4",
)
