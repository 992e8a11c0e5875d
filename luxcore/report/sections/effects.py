"""Only the effects a scene calls for: what the renderer switched on in each room, and why."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

from luxcore.report.content import Section, Strip, Table
from luxcore.report.gallery import Gallery
from luxcore.report.sections.dataset import rendered_views
from luxcore.report.sources import read_json

ROOMS_NAMED = 8
"""Rooms that a row names; of more, the count is given."""

Decision = tuple[str, str, str, str]
BOTH_WAYS = (
    "effect",
    "decided",
    "why",
    "CPU-s",
    "saved, CPU-s",
    "light the other way",
    "picture, of 255",
    "noise, of 255",
)


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
    both_ways = _both_ways(artifacts / "effects", gallery)
    return Section("Only the effects a room calls for", "effects", intro, (table, *both_ways))


def _both_ways(folder: Path, gallery: Gallery) -> list[Table | Strip]:
    """What each decision saves, where `python -m benchmarks.effects` has measured it."""
    measured = read_json(folder / "effects.json") or {"rooms": {}}
    blocks: list[Table | Strip] = []
    for room, rows in measured["rooms"].items():
        cells = tuple(
            (
                row["effect"],
                row["decided"],
                row["reason"],
                f"{row['seconds']:.2f}",
                f"{row['seconds_other'] - row['seconds']:+.2f}",
                f"{100 * row['light_other']:+.1f} %",
                f"{row['difference']:.2f}",
                f"{row['noise']:.2f}",
            )
            for row in rows
        )
        blocks.append(Table(f"{room}: each effect both ways", "render", BOTH_WAYS, cells))
        picture = gallery.copy(
            f"effects-{room}",
            folder / f"{room}.jpg",
            "as decided, the other way round, their difference amplified",
        )
        blocks.append(Strip(f"{room}: with and without", "render", (picture,), columns=1))
    return blocks


def _decision(name: str, effect: dict[str, Any]) -> Decision:
    on = bool(effect.get("on"))
    amount = str(effect.get("amount") or "") if on else ""
    return name.replace("_", " "), "on" if on else "off", amount, str(effect.get("reason", ""))


def _named(rooms: set[str]) -> str:
    if len(rooms) > ROOMS_NAMED:
        return f"{len(rooms)} rooms"
    return ", ".join(sorted(rooms))
