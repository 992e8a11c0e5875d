"""The floor of imported walls: the loop they close, or the rectangle around them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from luxcore.imports.scene_language import WallLine
from luxcore.rooms.shapes import Vec2

CORNER_M = 0.05
"""Wall ends nearer than this are one corner."""


def floor_outline(walls: Sequence[WallLine]) -> tuple[Vec2, ...]:
    """Counter-clockwise corners: of the single loop that all walls form, else of their bounds."""
    loop = _loop(walls)
    if loop is not None:
        return loop if signed_area(loop) > 0 else loop[::-1]
    xs = [x for w in walls for x in (w.a[0], w.b[0])]
    ys = [y for w in walls for y in (w.a[1], w.b[1])]
    low_x, high_x, low_y, high_y = min(xs), max(xs), min(ys), max(ys)
    return (low_x, low_y), (high_x, low_y), (high_x, high_y), (low_x, high_y)


def signed_area(outline: Sequence[Vec2]) -> float:
    """Positive for counter-clockwise corners."""
    ends = [*outline[1:], outline[0]]
    return 0.5 * sum(ax * by - bx * ay for (ax, ay), (bx, by) in zip(outline, ends, strict=True))


def is_inside(outline: Sequence[Vec2], x: float, y: float) -> bool:
    """Even-odd rule."""
    inside = False
    for (x0, y0), (x1, y1) in zip(outline, [*outline[1:], outline[0]], strict=True):
        if (y0 > y) != (y1 > y) and x < (x1 - x0) * (y - y0) / (y1 - y0) + x0:
            inside = not inside
    return inside


def spread_points(outline: Sequence[Vec2], count: int, away: Sequence[Vec2] = ()) -> list[Vec2]:
    """`count` points inside, far from the walls, from `away` and from each other."""
    xs, ys = zip(*outline, strict=True)
    steps = 24
    grid = [
        (
            min(xs) + (max(xs) - min(xs)) * (i + 0.5) / steps,
            min(ys) + (max(ys) - min(ys)) * (j + 0.5) / steps,
        )
        for i in range(steps)
        for j in range(steps)
    ]
    inside = [p for p in grid if is_inside(outline, *p)]
    room_for = {p: _wall_distance(outline, p) for p in inside}
    middle = (min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2
    chosen: list[Vec2] = []

    def freedom(point: Vec2) -> tuple[float, float]:
        """Half the gap to a neighbour is as good as the whole gap to a wall; ties to the middle."""
        gaps = [0.5 * math.dist(point, other) for other in (*chosen, *away)]
        return round(min([room_for[point], *gaps]), 2), -math.dist(point, middle)

    for _ in range(count if inside else 0):
        x, y = max(inside, key=freedom)
        chosen.append((round(x, 4), round(y, 4)))
    return chosen


def _loop(walls: Sequence[WallLine]) -> tuple[Vec2, ...] | None:
    left = [(w.a, w.b) for w in walls]
    start, end = left.pop(0)
    corners = [start]
    while left:
        following = [s for s in left if min(math.dist(s[0], end), math.dist(s[1], end)) < CORNER_M]
        if len(following) != 1:
            return None
        left.remove(following[0])
        corners.append(end)
        a, b = following[0]
        end = b if math.dist(a, end) < CORNER_M else a
    return tuple(corners) if math.dist(end, start) < CORNER_M and len(corners) > 2 else None


def _wall_distance(outline: Sequence[Vec2], point: Vec2) -> float:
    nearest = math.inf
    for a, b in zip(outline, [*outline[1:], outline[0]], strict=True):
        ux, uy = b[0] - a[0], b[1] - a[1]
        along = ((point[0] - a[0]) * ux + (point[1] - a[1]) * uy) / (ux * ux + uy * uy)
        along = min(1.0, max(0.0, along))
        nearest = min(nearest, math.dist(point, (a[0] + along * ux, a[1] + along * uy)))
    return nearest
