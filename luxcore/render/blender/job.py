"""One request of the Blender process: build the room if it is new, render, denoise, write."""

from __future__ import annotations

import resource
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from luxcore.data.compact import save_rendered
from luxcore.files.digests import value_digest
from luxcore.render.blender.lights import only_lamp
from luxcore.render.blender.passes import Passes, configure, render, sum_error
from luxcore.render.blender.scene import (
    AMBIENT_GROUP,
    EMITTER_INDEX,
    FIXTURE_INDEX,
    build_scene,
    place_camera,
)
from luxcore.render.compact import rendered_view
from luxcore.render.effects import Effects, analyse_effects
from luxcore.render.masks import dilated, lamp_masks
from luxcore.render.noise import joined, relative_noise
from luxcore.render.oidn import Denoiser, keep_energy
from luxcore.render.views import PanoramaView, View, view_from_json
from luxcore.rooms.model import Room

TOP_UP_SEED = 15_485_863
"""Added to the seed, so that a second render of a light is independent of the first."""


@dataclass(frozen=True)
class Cleaned:
    """One light after the denoiser."""

    image: np.ndarray
    energy: float
    """The factor that gave back what the denoiser took."""
    noise: float
    """Relative noise before the denoiser."""


class RenderJob:
    """Keeps the last room built, so that several views of it share one scene."""

    def __init__(self) -> None:
        self._built = ""
        self._scene: Any = None

    def render(self, request: dict[str, Any], out_dir: Path) -> dict[str, Any]:
        """Render one view into `out_dir/{name}.*`; returns CPU seconds by step."""
        room, view = Room.from_json(request["room"]), view_from_json(request["view"])
        clock = [_cpu_seconds()]
        effects = analyse_effects(room)
        self._build(room, effects, request["room"])
        place_camera(self._scene, view)
        clock.append(_cpu_seconds())
        passes = self._pass(effects, request, request["spp"], request["seed"])
        clock.append(_cpu_seconds())
        lights = self._cleaned(passes, request)
        clock.append(_cpu_seconds())
        topped_up = self._top_up(passes, lights, effects, request)
        clock.append(_cpu_seconds())
        surfaces = {
            "albedo": passes.albedo,
            "normal": passes.normal,
            "ray_distance_m": passes.ray_distance_m,
        }
        facts = {
            "spp": request["spp"],
            "denoise": request["denoise"],
            "sum_error": float(f"{sum_error(passes):.3g}"),
            "energy_factors": {k: round(v.energy, 4) for k, v in lights.items()},
            "noise": {k: round(v.noise, 4) for k, v in lights.items()},
            "topped_up": topped_up,
        }
        images = {name: light.image for name, light in lights.items()}
        masks = _masks(passes, room, view)
        rendered = rendered_view(room, view, images, surfaces, masks, effects, facts)
        save_rendered(rendered, out_dir / request["name"])
        clock.append(_cpu_seconds())
        steps = ("build", "render", "denoise", "top_up", "write")
        return dict(zip(steps, np.diff(clock).round(3).tolist(), strict=True))

    def _build(self, room: Room, effects: Effects, raw: dict[str, Any]) -> None:
        digest = value_digest(raw)
        if digest != self._built:
            self._built = ""
            self._scene = build_scene(room, effects)
            self._built = digest

    def _pass(self, effects: Effects, request: dict[str, Any], spp: int, seed: int) -> Passes:
        configure(self._scene, effects, spp=spp, seed=seed, threads=request["threads"])
        return render(self._scene)

    def _cleaned(self, passes: Passes, request: dict[str, Any]) -> dict[str, Cleaned]:
        """Ambient and each light, denoised apart."""
        names = [AMBIENT_GROUP, *sorted(n for n in passes.groups if n != AMBIENT_GROUP)]
        if request["denoise"] == "off":
            return {name: Cleaned(passes.groups[name], 1.0, 0.0) for name in names}
        denoiser = _denoiser(passes, request)
        lights = {n: _clean(passes, denoiser, n, passes.groups[n]) for n in names}
        denoiser.close()
        return lights

    def _top_up(
        self,
        passes: Passes,
        lights: dict[str, Cleaned],
        effects: Effects,
        request: dict[str, Any],
    ) -> str | None:
        """Render the worst lamp again by itself when its noise asks; returns its name."""
        lamps = {n: light.noise for n, light in lights.items() if n != AMBIENT_GROUP}
        worst = max(sorted(lamps), key=lambda n: lamps[n], default=None)
        if worst is None or lamps[worst] <= request["top_up_noise"]:
            return None
        spp = request["spp"] * request["top_up_factor"]
        with only_lamp(self._scene, int(worst.removeprefix("light_"))):
            extra = self._pass(effects, request, spp, request["seed"] + TOP_UP_SEED)
        noisy = joined(passes.groups[worst], request["spp"], extra.groups[worst], spp)
        denoiser = _denoiser(passes, request)
        lights[worst] = _clean(passes, denoiser, worst, noisy)
        denoiser.close()
        return worst


def _denoiser(passes: Passes, request: dict[str, Any]) -> Denoiser:
    return Denoiser(
        passes.guide_albedo,
        passes.guide_normal,
        quality=request["denoise"],
        threads=request["threads"],
    )


def _clean(passes: Passes, denoiser: Denoiser, name: str, noisy: np.ndarray) -> Cleaned:
    if not noisy.any():
        return Cleaned(noisy, 1.0, 0.0)
    emitting = np.rint(passes.index) % 10 == EMITTER_INDEX
    bright = passes.outside if name == AMBIENT_GROUP else emitting
    # Two pixels: as far as the renderer's pixel filter reaches. Across the seam even where the view
    # is no panorama: that leaves out a few pixels of the other border, and changes no mean.
    rim = dilated(dilated(bright, wraps=True), wraps=True)
    denoised = denoiser(noisy)
    image, energy = keep_energy(noisy, denoised, bright, rim)
    return Cleaned(image, energy, relative_noise(noisy, denoised, rim))


def _masks(passes: Passes, room: Room, view: View) -> dict[str, np.ndarray]:
    masks = lamp_masks(
        passes.index,
        len(room.lamps),
        fixture_code=FIXTURE_INDEX,
        emitter_code=EMITTER_INDEX,
        wraps=isinstance(view, PanoramaView),
    )
    return {**masks, "window": passes.outside}


def _cpu_seconds() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime
