"""Only the effects a scene calls for: what the renderer switched on in each room, and why."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from luxcore.report.content import Section, Table
from luxcore.report.gallery import Gallery
from luxcore.report.sections.dataset import rendered_views

ROOMS_SHOWN = 12


def chapter(artifacts: Path, gallery: Gallery, facts: dict[str, Any]) -> Section | None:
    """A table per distinct set of decisions, with the rooms that share it."""
    rooms: dict[str, dict[str, Any]] = {}
    for view in rendered_views(artifacts):
        rooms.setdefault(
            str(view.metadata.get("room", view.name)), view.metadata.get("effects", {})
        )
    rooms = {room: effects for room, effects in rooms.items() if effects}
    if not rooms:
        return None
    tables = tuple(_table(room, rooms[room]) for room in sorted(rooms)[:ROOMS_SHOWN])
    intro = (
        "Each room is analysed before it is rendered; an effect that it does not call for costs "
        f"nothing. {min(len(rooms), ROOMS_SHOWN)} of {len(rooms)} rooms are listed."
    )
    return Section("Only the effects a room calls for", "effects", intro, tables)


def _table(room: str, effects: dict[str, dict[str, Any]]) -> Table:
    rows = tuple(
        (name, "on" if e.get("on") else "off", str(e.get("amount") or ""), str(e.get("reason", "")))
        for name, e in sorted(effects.items())
    )
    return Table(f"Room {room}", "render", ("effect", "", "bounces or count", "why"), rows)
