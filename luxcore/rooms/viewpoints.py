"""Where panoramas are taken: at eye height, in the open, apart from each other and from lamps."""

from __future__ import annotations

import math

from luxcore.rooms.dice import Rng, between, pick
from luxcore.rooms.layout import Layout
from luxcore.rooms.model import Lamp
from luxcore.rooms.plan import Rect
from luxcore.rooms.shapes import Vec3

EYE_HEIGHT_M = (1.35, 1.7)
WANTED = 4
"""Panoramas a room in the paper; a small room gets fewer."""


def draw_viewpoints(rng: Rng, layout: Layout, lamps: list[Lamp]) -> tuple[Vec3, ...]:
    """One to four positions. The clearances shrink until at least one fits."""
    for shrink in (1.0, 0.6, 0.35, 0.1):
        found: list[Vec3] = []
        for _ in range(80):
            if len(found) == WANTED:
                break
            point = _candidate(rng, layout)
            if _is_free(point, layout, lamps, found, shrink):
                found.append(point)
        if found:
            return tuple(found)
    main = max(layout.plan.rects, key=lambda r: r.area)
    return (((main.x0 + main.x1) / 2, (main.y0 + main.y1) / 2, EYE_HEIGHT_M[0]),)


def _candidate(rng: Rng, layout: Layout) -> Vec3:
    rect = pick(rng, layout.plan.rects, [r.area for r in layout.plan.rects])
    return (
        between(rng, rect.x0, rect.x1),
        between(rng, rect.y0, rect.y1),
        between(rng, *EYE_HEIGHT_M),
    )


def _is_free(
    point: Vec3, layout: Layout, lamps: list[Lamp], found: list[Vec3], shrink: float
) -> bool:
    x, y, z = point
    around = Rect(x, y, x, y).grown(0.45 * shrink)
    if not layout.plan.holds(around) or z > layout.plan.ceiling_at(y) - 0.3:
        return False
    # A photographer stands on the floor; low furniture may be near, tall furniture may not.
    feet = Rect(x, y, x, y).grown(0.25 * shrink)
    if any(feet.overlap(p.rect) > 0 for p in layout.placed):
        return False
    near = (p for p in layout.placed if around.overlap(p.rect) > 0)
    if any(p.piece.height > z - 0.35 for p in near):
        return False
    if any(math.dist(point, lamp.position) < 0.6 * shrink for lamp in lamps):
        return False
    return all(math.dist(point, other) > 0.7 * shrink for other in found)
