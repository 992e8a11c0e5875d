"""Only the effects that a room calls for, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

from luxcore.rooms.model import Room

DIFFUSE_BOUNCES = 8
"""Fewer lose 12-40 % of the light of shaded lamps (measured in Cycles)."""

LIGHT_TREE_FROM = 2
"""Emitters (parts, spots, openings) from which Cycles' light tree pays: a render takes 1.1 to 1.9
times as long, its variance is 0.3 to 0.5 times as large."""

MATT_KINDS = frozenset({"paint", "stripes", "damask", "carpet", "rug", "fabric", "paper", "pane"})
"""Materials without a glossy lobe that could pass light on."""


@dataclass(frozen=True)
class Effect:
    """One decision of the renderer; `amount` where it is more than on or off (bounces)."""

    on: bool
    reason: str
    amount: int = 0


@dataclass(frozen=True)
class Effects:
    """Every decision for one room."""

    environment: Effect
    portals: Effect
    diffuse: Effect
    glossy: Effect
    transmission: Effect
    transparent: Effect
    caustics: Effect
    light_tree: Effect

    def to_json(self) -> dict[str, Any]:
        """{name: {"on", "reason", "amount"}} for the metadata of a view."""
        return {
            f.name: {"on": e.on, "reason": e.reason, "amount": e.amount}
            for f in fields(self)
            for e in [getattr(self, f.name)]
        }


def analyse_effects(room: Room) -> Effects:
    """Decide from what is in the room; nothing is rendered."""
    kinds = {room.materials[p.material].kind for p in room.parts if p.emits == 0}
    openings = len(room.openings)
    outside = openings > 0 and room.environment is not None
    emitters = sum(p.emits > 0 for p in room.parts) + len(room.spots) + openings * outside
    glass, mirror = "glass" in kinds, "mirror" in kinds
    polished = any(
        room.materials[p.material].roughness < 0.15 and room.materials[p.material].kind == "metal"
        for p in room.parts
    )
    return Effects(
        environment=Effect(
            outside, f"{openings} openings" if outside else "no opening lets daylight in"
        ),
        portals=Effect(outside, "one per opening" if outside else "no environment", openings),
        diffuse=Effect(True, "every surface returns light", DIFFUSE_BOUNCES),
        glossy=Effect(
            True,
            "a mirror or polished metal" if mirror or polished else "sheen on varnish only",
            5 if mirror or polished else 3,
        ),
        transmission=Effect(
            glass, "glass objects" if glass else "no refracting glass", 8 if glass else 0
        ),
        transparent=Effect("pane" in kinds, "thin panes" if "pane" in kinds else "no panes", 8),
        caustics=Effect(
            bool(kinds - MATT_KINDS),
            "varnish, metal or glass pass light on" if kinds - MATT_KINDS else "all is matt",
        ),
        light_tree=Effect(
            emitters >= LIGHT_TREE_FROM, f"{emitters} emitters, pays from {LIGHT_TREE_FROM}"
        ),
    )
