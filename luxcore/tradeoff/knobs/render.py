"""Samples per pixel, with and without the denoiser; light groups against separate renders."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from luxcore.files.digests import value_digest
from luxcore.files.exr import read_exr
from luxcore.render.unit import render_unit, view_job
from luxcore.render.views import PanoramaView
from luxcore.rooms.batch import demo_room
from luxcore.rooms.model import Room
from luxcore.settings.render import RenderSettings
from luxcore.settings.rooms import RoomsSettings
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
    room = bench.demo_room()
    truth = true_lights(bench.params.rooms, bench.params.render)
    return _Prepared(room, bench.scratch, bench.params.render, truth)


_TRUTH: dict[str, dict[str, np.ndarray]] = {}


def true_lights(rooms: RoomsSettings, settings: RenderSettings) -> dict[str, np.ndarray]:
    """The demo room's lamps that give any light, at TRUTH_SPP; rendered once for all knobs."""
    room = demo_room(rooms)
    key = value_digest(room.to_json())
    if key not in _TRUTH:
        exact = settings.model_copy(update={"denoise": "off"})
        with tempfile.TemporaryDirectory(prefix="lux-truth-") as folder:
            _TRUTH[key] = _render(room, exact, TRUTH_SPP, Path(folder), number=10_000)[1]
    return _TRUTH[key]


def _run(prepared: _Prepared, choice: Choice, repeat: int) -> Work:
    settings = prepared.settings.model_copy(update=choice.section("render"))
    folder = prepared.folder / "view"
    seconds, layers = _render(prepared.room, settings, settings.spp, folder, number=repeat)
    return Work(seconds, seconds, _error(prepared, layers))


def _run_separate(prepared: _Prepared, choice: Choice, repeat: int) -> Work:
    """The same lights from one render of all groups, or from a render each."""
    spp, way = int(choice.label.split()[0]), choice.label.split(", ")[1]
    room, lamps = prepared.room, range(len(prepared.room.lamps))
    seconds = 0.0
    layers: dict[str, np.ndarray] = {}
    rooms = {"": room} if way == "groups" else {f"light_{k:02d}": _only(room, k) for k in lamps}
    if way != "groups" and "ambient" in prepared.truth:
        rooms["ambient"] = _only(room, None)
    for number, (light, lit) in enumerate(rooms.items()):
        took, found = _render(
            lit, prepared.settings, spp, prepared.folder / "view", number=100 * repeat + number
        )
        seconds += took
        layers |= {k: v for k, v in found.items() if light in ("", k)}
    return Work(seconds, seconds, _error(prepared, layers))


def _only(room: Room, lamp: int | None) -> Room:
    """The room lit by one lamp, or by what comes through its openings."""
    parts = tuple(
        p if p.emits == 0 or p.lamp == lamp else replace(p, emits=0.0) for p in room.parts
    )
    spots = tuple(spot for spot in room.spots if spot.lamp == lamp)
    environment = room.environment if lamp is None else None
    return replace(room, parts=parts, spots=spots, environment=environment)


def _error(prepared: _Prepared, layers: dict[str, np.ndarray]) -> float:
    errors = [
        np.abs(layers[light] - exact).sum() / exact.sum() for light, exact in prepared.truth.items()
    ]
    return float(np.mean(errors))


def _render(
    room: Room, settings: RenderSettings, spp: int, folder: Path, *, number: int
) -> tuple[float, dict[str, np.ndarray]]:
    """Processor seconds of Blender's own process, and the lamps that give any light."""
    view = PanoramaView(room.viewpoints[0], 2 * HEIGHT, HEIGHT)
    job: dict[str, Any] = view_job(room, view, settings, name="view", spp=spp, number=number)
    steps = render_unit(folder, **job)
    layers = read_exr(folder / "view.exr")
    lights = {k: v for k, v in layers.items() if k == "ambient" or k.startswith("light_")}
    # A scene is built once for all views of a room: that is not part of a view.
    seconds = sum(float(took) for step, took in steps.items() if step != "build")
    return seconds, {k: v for k, v in lights.items() if v.sum() > 0}


def _choice(spp: int, denoise: str) -> Choice:
    label = f"{spp} spp" + (f" + {denoise}" if denoise != "off" else "")
    return Choice(label, {"render.spp": spp, "render.denoise": denoise})


DEFAULT = RenderSettings()
LOW, SPP, HIGH, VERY_HIGH = around(DEFAULT.spp, 0.5, 1, 4, 16)

SAMPLES = Knob(
    name="samples per pixel and denoiser",
    work="a view rendered",
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

SEPARATE = Knob(
    name="light groups or separate renders",
    work="a view rendered",
    choices=tuple(
        Choice(f"{spp} spp, {way}", {})
        for spp, way in (
            *((spp, "groups") for spp in (LOW, SPP, HIGH)),
            *((spp, "separate") for spp in (max(1, LOW // 2), LOW, SPP)),
        )
    ),
    error="mean error of a lamp, share of its light",
    why="One render of all groups costs little more than a render of one lamp, and its lamps share "
    "the samples: at equal error it is the cheaper way.",
    prepare=_prepare,
    run=_run_separate,
    fixed_default=f"{SPP} spp, groups",
)
