"""Run in Blender's process: rooms with and without each effect, rendered both ways, as JSON.

`python -m tests.render.flip_effects` prints {case: {"decided", "light", "changed"}}: what the
analysis decided, how much light the other way has, and which share of the pixels differs by more
than a tenth of the picture's mean.
"""

from __future__ import annotations

import argparse
import json
import os
from dataclasses import replace

import numpy as np

from benchmarks.render import Bench, photo, with_effect
from luxcore.render.effects import Effects, analyse_effects
from luxcore.rooms import Material, Part, Room, generate_room
from luxcore.rooms.model import Environment
from luxcore.rooms.shapes import Ellipsoid
from luxcore.settings.rooms import RoomsSettings

HEIGHT, SPP = 32, 64
VISIBLE = 0.1


def rooms() -> dict[str, Room]:
    """A generated room as it is, all matt, with a thing in front of the camera, closed, dim."""
    drawn = [generate_room(seed, RoomsSettings()) for seed in range(40)]
    whole = next(r for r in drawn if r.openings)
    matt = replace(whole, materials=dict.fromkeys(whole.materials, Material("paint", (0.6,) * 3)))
    closed = next(r for r in drawn if not r.openings)
    # One emitter: the largest of the first lamp gives all of its light.
    first = max((p for p in closed.parts if p.emits > 0), key=lambda p: p.emits)
    dark = tuple(replace(p, emits=1.0 if p is first else 0.0) for p in closed.parts)
    return {
        "whole": whole,
        "matt": matt,
        "glass": _with_ball(matt, Material("glass", (0.95, 0.95, 0.95))),
        "mirror": _with_ball(matt, Material("mirror", (0.9, 0.9, 0.9))),
        "closed": replace(closed, environment=Environment("courtyard", 0.0, 5.0)),
        "one emitter": replace(closed, parts=dark, spots=()),
    }


def cases() -> dict[str, tuple[Room, Effects, Effects]]:
    """Name → room, as decided, the other way round."""
    found = {}
    of = rooms()
    for name, room, field, amount in (
        ("environment on", "whole", "environment", 0),
        ("environment off", "closed", "environment", 0),
        ("portals on", "whole", "portals", 0),
        ("transmission on", "glass", "transmission", 0),
        ("transmission off", "matt", "transmission", 8),
        ("caustics on", "whole", "caustics", 0),
        ("caustics off", "matt", "caustics", 0),
        ("glossy on", "mirror", "glossy", 0),
        ("glossy off", "matt", "glossy", 5),
        ("light_tree on", "whole", "light_tree", 0),
        ("light_tree off", "one emitter", "light_tree", 0),
    ):
        decided = analyse_effects(of[room])
        on = getattr(decided, field).on
        found[name] = (of[room], decided, with_effect(decided, field, not on, amount))
    return found


def flip(room: Room, decided: Effects, other: Effects, field: str) -> dict[str, object]:
    """Render both ways with the same random numbers."""
    pictures = []
    for effects in (decided, other):
        passes, _ = Bench(room, effects, HEIGHT).render(SPP, 7)
        pictures.append(photo(room, passes))
    level = pictures[0].mean()
    change = np.abs(pictures[1] - pictures[0]).mean(axis=2) / level
    return {
        "decided": getattr(decided, field).on,
        "light": float(pictures[1].mean() / level),
        "changed": float((change > VISIBLE).mean()),
    }


def _with_ball(room: Room, material: Material) -> Room:
    x, y, z = room.viewpoints[0]
    ball = Part("ball", Ellipsoid((0.3, 0.3, 0.3)), "ball", (x, y, z - 0.7), smooth=True)
    return replace(room, materials={**room.materials, "ball": material}, parts=(*room.parts, ball))


def main() -> None:
    """Print the JSON on a line of its own; Blender's chatter goes to standard error."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    answer = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    found = {n: flip(*case, field=n.split(" ")[0]) for n, case in cases().items()}
    answer.write(json.dumps(found) + "\n")
    answer.flush()


if __name__ == "__main__":
    main()
