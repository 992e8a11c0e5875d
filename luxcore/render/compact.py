"""The compact form of one rendered view: `name.exr`, `.geometry.exr`, `.masks.exr`, `.json`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from luxcore.files.atomic import write_json
from luxcore.files.exr import write_exr
from luxcore.render.effects import Effects
from luxcore.render.hdri import LUMINANCE
from luxcore.render.views import View, view_to_json
from luxcore.rooms.model import Room

COMPACT_VERSION = 1
KEY_LUMINANCE = 0.18
"""Where the exposure puts the middle of the input photo (log-average of its darker 95 %)."""


@dataclass(frozen=True)
class RenderedView:
    """What one render gave, before it is written."""

    room: Room
    view: View
    images: dict[str, np.ndarray]
    """`ambient`, `light_00`, …: [h, w, 3] linear radiance, lamps white at 1 W."""
    albedo: np.ndarray
    normal: np.ndarray
    ray_distance_m: np.ndarray
    masks: dict[str, np.ndarray]
    effects: Effects
    spp: int
    energy: dict[str, float]
    """The factor that kept each light's energy through the denoiser."""


def input_linear(room: Room, images: dict[str, np.ndarray]) -> np.ndarray:
    """The photo as taken: ambient + Σ on·scale·light (equation 1), [h, w, 3] linear radiance."""
    total = np.asarray(images["ambient"], np.float32).copy()
    for lamp in room.lamps:
        if lamp.on:
            total += np.array(lamp.scale, np.float32) * images[f"light_{lamp.id:02d}"]
    return total


def photo_exposure(image: np.ndarray) -> float:
    """The factor g that brings the log-average luminance of the darker 95 % to KEY_LUMINANCE."""
    luminance = (image @ LUMINANCE).ravel()
    kept = np.sort(luminance)[: max(1, int(0.95 * luminance.size))]
    return float(KEY_LUMINANCE / np.exp(np.log(kept + 1e-6).mean()))


def write_view(folder: Path, name: str, rendered: RenderedView) -> None:
    """Write the four files. Pixels depend on nothing but the room, the view and the settings."""
    images = {**rendered.images, "albedo": rendered.albedo, "normal": rendered.normal}
    clipped = write_exr(folder / f"{name}.exr", images)
    geometry = {"ray_distance_m": rendered.ray_distance_m, "normal": rendered.normal}
    write_exr(folder / f"{name}.geometry.exr", geometry, half=False)
    masks = {k: m.astype(np.float32) for k, m in rendered.masks.items()}
    write_exr(folder / f"{name}.masks.exr", masks)
    write_json(folder / f"{name}.json", {**view_metadata(rendered), "clipped_values": clipped})


def view_metadata(rendered: RenderedView) -> dict[str, Any]:
    """The JSON beside the pixels; without times, so that equal renders give equal bytes."""
    room = rendered.room
    environment = room.environment
    return {
        "version": COMPACT_VERSION,
        **view_to_json(rendered.view),
        "room": room.id,
        "seed": room.seed,
        "use": room.use,
        "lamps": [
            {
                "id": lamp.id,
                "name": lamp.name,
                "kind": lamp.kind,
                "design": lamp.design,
                "position": list(lamp.position),
                "power_w": lamp.power_w,
                "temperature_k": lamp.temperature_k,
                "color": list(lamp.color),
                "on": lamp.on,
                "scale": list(lamp.scale),
            }
            for lamp in room.lamps
        ],
        "environment": None
        if environment is None
        else {
            "hdri": Path(environment.hdri).stem,
            "rotation_deg": environment.rotation_deg,
            "mean_radiance": environment.mean_radiance,
        },
        "exposure": photo_exposure(input_linear(room, rendered.images)),
        "effects": rendered.effects.to_json(),
        "energy_factors": {k: round(v, 4) for k, v in rendered.energy.items()},
        "spp": rendered.spp,
    }
