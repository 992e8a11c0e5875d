"""One unit of work: one view of one room, rendered into a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from luxcore.render.process import shared_blender
from luxcore.render.views import View, view_to_json
from luxcore.rooms.model import Room
from luxcore.settings.render import RenderSettings

NOT_IN_THE_PIXELS = ("timeout_s", "memory_mb")
"""Arguments of a unit that do not belong to its key."""

RENDER_CODE = (
    "luxcore/render",
    "luxcore/rooms/model.py",
    "luxcore/rooms/shapes.py",
    "luxcore/light/blackbody.py",
)
"""What a rendered view depends on beside its arguments (for the key of its unit)."""


def view_job(
    room: Room, view: View, settings: RenderSettings, *, name: str, spp: int, number: int = 0
) -> dict[str, Any]:
    """The JSON arguments of `render_unit`. `number` tells the views of a room apart (noise)."""
    return {
        "room": room.to_json(),
        "view": view_to_json(view),
        "name": name,
        "spp": spp,
        "seed": room.seed * 1009 + number,
        "denoise": settings.denoise,
        "top_up_noise": settings.top_up_noise,
        "top_up_factor": settings.top_up_factor,
        "timeout_s": settings.timeout_s,
        "memory_mb": settings.memory_mb,
    }


def render_unit(out_dir: Path, *, threads: int = 1, timeout_s: float, **job: Any) -> dict[str, Any]:
    """Write the compact form of one view into `out_dir`; returns CPU seconds by step.

    Pixels do not depend on `threads`. Raises LuxError when Blender fails or takes too long.
    """
    out_dir.mkdir(parents=True, exist_ok=True)
    request = {**job, "threads": threads, "out_dir": str(out_dir.absolute())}
    return shared_blender().request(request, timeout_s)


def render_view(
    room: Room, view: View, settings: RenderSettings, out_dir: Path, *, name: str = "0000"
) -> dict[str, Any]:
    """Render one view of a room without the unit store; files as in `luxcore.render.compact`."""
    return render_unit(out_dir, **view_job(room, view, settings, name=name, spp=settings.spp))
