"""From one render to a `luxcore.data` view: lamps, camera, exposure, and why it was made so."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from luxcore.cameras import Camera
from luxcore.data import compact
from luxcore.light.blackbody import LUMINANCE_709
from luxcore.render.effects import Effects
from luxcore.render.hdri import hdri_path, usable_radiance
from luxcore.render.views import View, view_to_json
from luxcore.rooms.model import Lamp, Room

KEY_LUMINANCE = 0.18
"""Where the exposure puts the middle of the input photo (log-average of its darker 95 %)."""


def rendered_view(
    room: Room,
    view: View,
    images: dict[str, np.ndarray],
    surfaces: dict[str, np.ndarray],
    masks: dict[str, np.ndarray],
    effects: Effects,
    render_facts: dict[str, Any],
) -> compact.RenderedView:
    """Put one render together.

    `images`: `ambient`, `light_00`, …: [h, w, 3] linear radiance, lamps white at 1 W.
    `surfaces`: `albedo`, `normal` [h, w, 3] and `ray_distance_m` [h, w].
    `masks`: `emitter_00`, `fixture_00`, `hull_00`, … and `window`, [h, w] bool.
    `render_facts`: samples, energy factors; without times, so that equal renders give equal bytes.
    """
    lamps = range(len(room.lamps))
    empty = np.zeros((0, *images["ambient"].shape), np.float32)
    lights = np.stack([images[f"light_{k:02d}"] for k in lamps]) if lamps else empty
    burning = np.array([lamp.on * np.array(lamp.scale) for lamp in room.lamps], np.float32)
    photo = compact.compose(images["ambient"], lights, burning)
    about = view_to_json(view)
    return compact.RenderedView(
        room=room.id,
        kind=about["kind"],
        c2w=view.c2w,
        camera=view if isinstance(view, Camera) else None,
        ambient=images["ambient"],
        lights=lights,
        albedo=surfaces["albedo"],
        normal=surfaces["normal"],
        ray_distance_m=surfaces["ray_distance_m"],
        masks={
            kind: np.stack([masks[f"{kind}_{k:02d}"] for k in lamps]) for kind in compact.MASK_KINDS
        },
        window=masks["window"],
        lamps=tuple(_lamp(lamp) for lamp in room.lamps),
        exposure=photo_exposure(photo),
        metadata={
            **about,
            "room": room.id,
            "seed": room.seed,
            "use": room.use,
            "lamps": [
                {"design": lamp.design, "temperature_k": lamp.temperature_k} for lamp in room.lamps
            ],
            "environment": _environment(room),
            "effects": effects.to_json(),
            **render_facts,
        },
    )


def photo_exposure(image: Float[np.ndarray, "h w 3"]) -> float:
    """The factor g that brings the log-average luminance of the darker 95 % to KEY_LUMINANCE."""
    luminance = (image @ LUMINANCE_709.astype(np.float32)).ravel()
    kept = np.sort(luminance)[: max(1, int(0.95 * luminance.size))]
    return float(KEY_LUMINANCE / np.exp(np.log(kept + 1e-6).mean()))


def _lamp(lamp: Lamp) -> compact.Lamp:
    return compact.Lamp(
        lamp.name, lamp.kind, lamp.position, lamp.power_w, lamp.color, lamp.on, lamp.scale
    )


def _environment(room: Room) -> dict[str, Any] | None:
    environment = room.environment
    if environment is None:
        return None
    _, changed = usable_radiance(hdri_path(environment.hdri))
    return {
        "hdri": Path(environment.hdri).stem,
        "rotation_deg": environment.rotation_deg,
        "mean_radiance": environment.mean_radiance,
        **({"changed_values": changed} if changed else {}),
    }
