"""Only the effects a scene calls for: what the renderer switched on in each room, and why."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

from luxcore.report.content import Section, Table
from luxcore.report.gallery import Gallery
from luxcore.report.sections.dataset import rendered_views

ROOMS_NAMED = 8
"""Rooms that a row names; of more, the count is given."""

Decision = tuple[str, str, str, str]


def chapter(artifacts: Path, gallery: Gallery, facts: dict[str, Any]) -> Section | None:
    """One row per decision and reason, with the rooms that share it."""
    rooms: dict[Decision, set[str]] = defaultdict(set)
    for view in rendered_views(artifacts):
        for name, effect in view.metadata.get("effects", {}).items():
            rooms[_decision(name, effect)].add(str(view.metadata["room"]))
    if not rooms:
        return None
    rows = tuple((*decision, _named(rooms[decision])) for decision in sorted(rooms))
    columns = ("effect", "", "bounces or count", "why", "rooms")
    intro = (
        "Each room is analysed before it is rendered; an effect that it does not call for costs "
        "nothing."
    )
    table = Table("What was switched on", "render", columns, rows)
    return Section("Only the effects a room calls for", "effects", intro, (table,))


def _decision(name: str, effect: dict[str, Any]) -> Decision:
    on = bool(effect.get("on"))
    amount = str(effect.get("amount") or "") if on else ""
    return name.replace("_", " "), "on" if on else "off", amount, str(effect.get("reason", ""))


def _named(rooms: set[str]) -> str:
    if len(rooms) > ROOMS_NAMED:
        return f"{len(rooms)} rooms"
    return ", ".join(sorted(rooms))
