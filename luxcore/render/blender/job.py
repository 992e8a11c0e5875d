"""One request of the Blender process: build the room if it is new, render, denoise, write."""

from __future__ import annotations

import resource
from pathlib import Path
from typing import Any

import numpy as np

from luxcore.data.compact import save_rendered
from luxcore.files.digests import value_digest
from luxcore.render.blender.passes import Passes, configure, render
from luxcore.render.blender.scene import (
    AMBIENT_GROUP,
    EMITTER_INDEX,
    FIXTURE_INDEX,
    build_scene,
    lamp_group,
    place_camera,
)
from luxcore.render.compact import rendered_view
from luxcore.render.effects import analyse_effects
from luxcore.render.masks import lamp_masks
from luxcore.render.oidn import Denoiser, keep_energy
from luxcore.render.views import PanoramaView, View, view_from_json
from luxcore.rooms.model import Room


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
        self._build(room, request["room"])
        place_camera(self._scene, view)
        configure(
            self._scene,
            effects,
            spp=request["spp"],
            seed=request["seed"],
            threads=request["threads"],
        )
        clock.append(_cpu_seconds())
        passes = render(self._scene)
        clock.append(_cpu_seconds())
        masks = _masks(passes, room, view)
        images, factors = _denoised(passes, masks, len(room.lamps), request)
        clock.append(_cpu_seconds())
        surfaces = {
            "albedo": passes.albedo,
            "normal": passes.normal,
            "ray_distance_m": passes.ray_distance_m,
        }
        facts = {
            "spp": request["spp"],
            "denoise": request["denoise"],
            "energy_factors": {k: round(v, 4) for k, v in factors.items()},
        }
        rendered = rendered_view(room, view, images, surfaces, masks, effects, facts)
        save_rendered(rendered, out_dir / request["name"])
        clock.append(_cpu_seconds())
        steps = ("build", "render", "denoise", "write")
        return dict(zip(steps, np.diff(clock).round(3).tolist(), strict=True))

    def _build(self, room: Room, raw: dict[str, Any]) -> None:
        digest = value_digest(raw)
        if digest != self._built:
            self._built = ""
            self._scene = build_scene(room, analyse_effects(room))
            self._built = digest


def _masks(passes: Passes, room: Room, view: View) -> dict[str, np.ndarray]:
    masks = lamp_masks(
        passes.index,
        len(room.lamps),
        fixture_code=FIXTURE_INDEX,
        emitter_code=EMITTER_INDEX,
        wraps=isinstance(view, PanoramaView),
    )
    return {**masks, "window": passes.outside}


def _denoised(
    passes: Passes, masks: dict[str, np.ndarray], lamps: int, request: dict[str, Any]
) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """Ambient and each light, denoised apart; and the energy factor that each was given."""
    names = [AMBIENT_GROUP, *(lamp_group(k) for k in range(lamps))]
    if request["denoise"] == "off":
        return {name: passes.groups[name] for name in names}, dict.fromkeys(names, 1.0)
    denoiser = Denoiser(
        passes.guide_albedo,
        passes.guide_normal,
        quality=request["denoise"],
        threads=request["threads"],
    )
    images, factors = {}, {}
    for name in names:
        noisy = passes.groups[name]
        if not noisy.any():
            images[name], factors[name] = noisy, 1.0
            continue
        emitter = np.rint(passes.index) % 10 == EMITTER_INDEX
        bright = passes.outside if name == AMBIENT_GROUP else emitter
        images[name], factors[name] = keep_energy(noisy, denoiser(noisy), bright)
    denoiser.close()
    return images, factors


def _cpu_seconds() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime
