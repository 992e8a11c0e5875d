"""Numbers about one rendered view, for the page that a shard's reader looks at first."""

from __future__ import annotations

from typing import Any

from luxcore.data.compact import RenderedView


def view_statistics(view: RenderedView) -> dict[str, Any]:
    """Lamps with their colours, mask areas in pixels, noise, energy factors, clipped values."""
    lamps = [
        {
            "name": lamp.name,
            "kind": lamp.kind,
            "design": view.metadata["lamps"][k].get("design"),
            "on": lamp.on,
            "power_w": lamp.power_w,
            "color": list(lamp.color),
            "emitter_px": int(view.masks["emitter"][k].sum()),
            "fixture_px": int(view.masks["fixture"][k].sum()),
            "noise": view.metadata["noise"][f"light_{k:02d}"],
            "energy_factor": view.metadata["energy_factors"][f"light_{k:02d}"],
        }
        for k, lamp in enumerate(view.lamps)
    ]
    return {
        "room": view.room,
        "use": view.metadata["use"],
        "lamps": lamps,
        "window_px": int(view.window.sum()),
        "clipped_values": view.metadata["clipped_values"],
        "topped_up": view.metadata["topped_up"],
        "effects": view.metadata["effects"],
    }
