"""Samples per pixel, with and without the denoiser."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from luxcore.files.exr import read_exr
from luxcore.render.unit import render_unit, view_job
from luxcore.render.views import PanoramaView
from luxcore.rooms.batch import demo_room
from luxcore.rooms.model import Room
from luxcore.settings.render import RenderSettings
from luxcore.tradeoff.knob import Bench, Choice, Knob, Work, around

HEIGHT = 64
"""Rows of the panorama that is rendered: noise for each sample does not depend on size."""
TRUTH_SPP = 768


@dataclass(frozen=True)
class _Prepared:
    room: Room
    folder: Path
    settings: RenderSettings
    truth: dict[str, np.ndarray]


def _prepare(bench: Bench) -> _Prepared:
    room = demo_room(bench.params.rooms)
    exact = bench.params.render.model_copy(update={"denoise": "off"})
    _, truth = _render(room, exact, TRUTH_SPP, bench.scratch / "truth", number=10_000)
    return _Prepared(room, bench.scratch, bench.params.render, truth)


def _run(prepared: _Prepared, choice: Choice, repeat: int) -> Work:
    settings = prepared.settings.model_copy(
        update={name.removeprefix("render."): value for name, value in choice.settings.items()}
    )
    name = choice.label.replace(" ", "-")
    folder = prepared.folder / f"{name}-{repeat}"
    seconds, layers = _render(prepared.room, settings, settings.spp, folder, number=repeat)
    errors = [
        np.abs(layers[light] - exact).sum() / exact.sum() for light, exact in prepared.truth.items()
    ]
    return Work(seconds, seconds, float(np.mean(errors)))


def _render(
    room: Room, settings: RenderSettings, spp: int, folder: Path, *, number: int
) -> tuple[float, dict[str, np.ndarray]]:
    """Processor seconds of Blender's own process, and the lamps that give any light."""
    view = PanoramaView(room.viewpoints[0], 2 * HEIGHT, HEIGHT)
    job: dict[str, Any] = view_job(room, view, settings, name="view", spp=spp, number=number)
    steps = render_unit(folder, **job)
    layers = read_exr(folder / "view.exr")
    lights = {k: v for k, v in layers.items() if k == "ambient" or k.startswith("light_")}
    return _seconds(steps), {k: v for k, v in lights.items() if v.sum() > 0}


def _seconds(steps: dict[str, Any]) -> float:
    return float(sum(value for value in steps.values() if isinstance(value, (int, float))))


def _choice(spp: int, denoise: str) -> Choice:
    label = f"{spp} spp" + (f" + {denoise}" if denoise != "off" else "")
    return Choice(label, {"render.spp": spp, "render.denoise": denoise})


DEFAULT = RenderSettings()
LOW, SPP, HIGH, VERY_HIGH = around(DEFAULT.spp, 0.5, 1, 4, 16)

SAMPLES = Knob(
    name="samples per pixel and denoiser",
    choices=tuple(
        _choice(spp, denoise)
        for spp, denoise in (
            *((spp, "off") for spp in (LOW, SPP, HIGH, VERY_HIGH)),
            *((spp, DEFAULT.denoise) for spp in (LOW, SPP, HIGH)),
            *((SPP, other) for other in ("fast", "balanced", "high") if other != DEFAULT.denoise),
        )
    ),
    error="mean error of a lamp, share of its light",
    why="A denoised render of few samples is as right as an undenoised one of many times more, "
    "and below the default's samples the denoiser starts to invent.",
    prepare=_prepare,
    run=_run,
)
