"""What the denoiser is run on: nothing, the photo as a whole, or every lamp by itself."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from luxcore.files.exr import read_exr
from luxcore.render.oidn import Denoiser
from luxcore.render.unit import render_unit, view_job
from luxcore.render.views import PanoramaView
from luxcore.rooms.model import Room
from luxcore.settings.render import RenderSettings
from luxcore.tradeoff.knob import Bench, Choice, Knob, Work, stopwatch
from luxcore.tradeoff.knobs.render import HEIGHT, true_lights

NOTHING, WHOLE, EACH = "nothing", "the sum of all lamps", "each lamp"


@dataclass(frozen=True)
class _Prepared:
    room: Room
    settings: RenderSettings
    folder: Path
    truth: dict[str, np.ndarray]
    scales: dict[str, np.ndarray]


def _prepare(bench: Bench) -> _Prepared:
    room = bench.demo_room()
    settings = bench.params.render.model_copy(update={"denoise": "off"})
    scales = {"ambient": np.ones(3, np.float32)}
    for index, lamp in enumerate(room.lamps):
        scales[f"light_{index:02d}"] = np.array(lamp.scale, np.float32)
    truth = true_lights(bench.params.rooms, bench.params.render)
    return _Prepared(room, settings, bench.scratch, truth, scales)


def _render(prepared: _Prepared, spp: int, number: int) -> tuple[dict[str, np.ndarray], float]:
    """The noisy layers and the processor seconds of their render."""
    room = prepared.room
    view = PanoramaView(room.viewpoints[0], 2 * HEIGHT, HEIGHT)
    job = view_job(room, view, prepared.settings, name="noisy", spp=spp, number=number)
    steps = render_unit(prepared.folder, **job)
    return read_exr(prepared.folder / "noisy.exr"), float(steps["render"])


def _run(prepared: _Prepared, choice: Choice, repeat: int) -> Work:
    layers, rendered_s = _render(prepared, prepared.settings.spp, repeat)
    noisy = {name: layers[name][..., :3] for name in prepared.truth}
    with stopwatch() as watch:
        clean = _denoised(choice.label, noisy, layers, prepared.scales)
    errors = [np.abs(clean[k] - t).sum() / t.sum() for k, t in prepared.truth.items()]
    seconds = rendered_s + watch.cpu_s
    return Work(seconds, rendered_s + watch.wall_s, float(np.mean(errors)))


def _denoised(
    way: str,
    noisy: dict[str, np.ndarray],
    layers: dict[str, np.ndarray],
    scales: dict[str, np.ndarray],
) -> dict[str, np.ndarray]:
    if way == NOTHING:
        return noisy
    quality = RenderSettings().denoise
    denoiser = Denoiser(
        layers["albedo"][..., :3], layers["normal"][..., :3], quality=quality, threads=1
    )
    try:
        if way == EACH:
            return {name: denoiser(light) for name, light in noisy.items()}
        total = sum(scales[name] * light for name, light in noisy.items())
        ratio = denoiser(total) / np.maximum(total, 1e-6)
        return {name: light * ratio for name, light in noisy.items()}
    finally:
        denoiser.close()


DENOISED = Knob(
    name="what is denoised",
    work="a view rendered",
    choices=tuple(Choice(label, {}) for label in (NOTHING, WHOLE, EACH)),
    error="mean error of a lamp, share of its light",
    why="Lamps are noisy in different places: the denoised sum shares its cleaning among them and "
    "leaves most of each one's noise, while a pass for each lamp takes little time.",
    prepare=_prepare,
    run=_run,
    fixed_default=EACH,
)
