"""The floor plan: a union of axis-aligned rectangles, its outline, its walls, its ceiling."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from luxcore.rooms.dice import Rng, between, chance, pick
from luxcore.rooms.shapes import Vec2, Vec3

Ceiling = Literal["flat", "beams", "slope"]
WALL_THICKNESS_M = 0.18

USES = ("living", "bedroom", "kitchen", "office", "dining", "corridor")
_SIZES = {
    "living": ((3.8, 6.5), (3.4, 5.5)),
    "bedroom": ((3.2, 5.0), (3.0, 4.4)),
    "kitchen": ((3.0, 5.0), (2.8, 4.2)),
    "office": ((2.8, 4.6), (2.6, 4.0)),
    "dining": ((3.4, 5.4), (3.0, 4.6)),
    "corridor": ((4.0, 7.0), (1.5, 2.2)),
}


@dataclass(frozen=True)
class Rect:
    """An axis-aligned rectangle on the floor, metres."""

    x0: float
    y0: float
    x1: float
    y1: float

    @property
    def area(self) -> float:
        return max(0.0, self.x1 - self.x0) * max(0.0, self.y1 - self.y0)

    def overlap(self, other: Rect) -> float:
        """The area that both cover."""
        return Rect(
            max(self.x0, other.x0),
            max(self.y0, other.y0),
            min(self.x1, other.x1),
            min(self.y1, other.y1),
        ).area

    def grown(self, margin: float) -> Rect:
        """Moved outward on every side."""
        return Rect(self.x0 - margin, self.y0 - margin, self.x1 + margin, self.y1 + margin)


@dataclass(frozen=True)
class Wall:
    """One side of the outline. Its frame: x along the wall, y into the room, z up."""

    start: Vec2
    end: Vec2

    @property
    def length(self) -> float:
        return math.dist(self.start, self.end)

    @property
    def yaw_deg(self) -> float:
        return math.degrees(math.atan2(self.end[1] - self.start[1], self.end[0] - self.start[0]))

    @property
    def inward(self) -> Vec2:
        dx, dy = self.end[0] - self.start[0], self.end[1] - self.start[1]
        return (-dy / self.length, dx / self.length)

    def point(self, along: float, inward: float = 0.0) -> Vec2:
        """A point `along` metres from the start and `inward` metres into the room."""
        dx = (self.end[0] - self.start[0]) / self.length
        dy = (self.end[1] - self.start[1]) / self.length
        nx, ny = self.inward
        x = self.start[0] + dx * along + nx * inward
        y = self.start[1] + dy * along + ny * inward
        return (round(x, 5), round(y, 5))


@dataclass(frozen=True)
class FloorPlan:
    """Shape of the empty room."""

    use: str
    rects: tuple[Rect, ...]
    """They touch and do not overlap."""
    outline: tuple[Vec2, ...]
    height: float
    ceiling: Ceiling
    slope_low: float = 0.0
    """Height of a sloping ceiling at the smallest y; `height` is at the largest."""

    @property
    def walls(self) -> tuple[Wall, ...]:
        """Counter-clockwise, so that the room lies to the left."""
        ends = (*self.outline[1:], self.outline[0])
        return tuple(Wall(a, b) for a, b in zip(self.outline, ends, strict=True))

    @property
    def bounds(self) -> Rect:
        xs, ys = zip(*self.outline, strict=True)
        return Rect(min(xs), min(ys), max(xs), max(ys))

    def holds(self, rect: Rect) -> bool:
        """Whether a rectangle lies inside the room."""
        return sum(r.overlap(rect) for r in self.rects) > rect.area - 1e-6

    def ceiling_at(self, y: float) -> float:
        """Height of the ceiling above a point with this y."""
        if self.ceiling != "slope":
            return self.height
        box = self.bounds
        share = (y - box.y0) / (box.y1 - box.y0)
        return self.slope_low + share * (self.height - self.slope_low)

    def lift(self, point: Vec2, drop: float = 0.0) -> Vec3:
        """The point of the ceiling above a point of the floor, lowered by `drop`."""
        return (point[0], point[1], round(self.ceiling_at(point[1]) - drop, 4))


def draw_plan(rng: Rng) -> FloorPlan:
    """A plan by use: most rooms are rectangles; some have an L-shape, an alcove or a slope."""
    use = pick(rng, USES, (0.3, 0.2, 0.15, 0.15, 0.12, 0.08))
    (w_low, w_high), (d_low, d_high) = _SIZES[use]
    width, depth = between(rng, w_low, w_high), between(rng, d_low, d_high)
    height = between(rng, 2.35, 3.1)
    form = pick(rng, ("box", "ell", "alcove"), (0.55, 0.25, 0.2))
    if use == "corridor" or min(width, depth) < 3.0:
        form = "box"
    rects, outline = _shape(rng, form, width, depth)
    ceiling: Ceiling = pick(rng, ("flat", "beams", "slope"), (0.7, 0.17, 0.13))
    if ceiling == "slope" and form == "box" and use != "corridor":
        return FloorPlan(use, rects, outline, height + 0.5, "slope", between(rng, 1.9, 2.3))
    return FloorPlan(use, rects, outline, height, "beams" if ceiling == "beams" else "flat")


def _shape(
    rng: Rng, form: str, width: float, depth: float
) -> tuple[tuple[Rect, ...], tuple[Vec2, ...]]:
    outline: tuple[Vec2, ...]
    rects: tuple[Rect, ...]
    if form == "ell":
        cut_x = round(width * between(rng, 0.5, 0.7), 3)
        cut_y = round(depth * between(rng, 0.45, 0.65), 3)
        outline = (
            (0.0, 0.0),
            (width, 0.0),
            (width, cut_y),
            (cut_x, cut_y),
            (cut_x, depth),
            (0.0, depth),
        )
        rects = (Rect(0.0, 0.0, cut_x, depth), Rect(cut_x, 0.0, width, cut_y))
    elif form == "alcove":
        left = round(width * between(rng, 0.15, 0.35), 3)
        right = round(left + width * between(rng, 0.3, 0.45), 3)
        deep = round(depth + between(rng, 0.5, 1.0), 3)
        outline = (
            (0.0, 0.0),
            (width, 0.0),
            (width, depth),
            (right, depth),
            (right, deep),
            (left, deep),
            (left, depth),
            (0.0, depth),
        )
        rects = (Rect(0.0, 0.0, width, depth), Rect(left, depth, right, deep))
    else:
        outline = ((0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth))
        rects = (Rect(0.0, 0.0, width, depth),)
    return _turned(rects, outline, chance(rng, 0.5))


def _turned(
    rects: tuple[Rect, ...], outline: tuple[Vec2, ...], swap: bool
) -> tuple[tuple[Rect, ...], tuple[Vec2, ...]]:
    """Half of the rooms are the mirror image, so that L-shapes turn either way."""
    if not swap:
        return rects, outline
    width = max(x for x, _ in outline)
    mirrored = tuple((round(width - x, 5), y) for x, y in reversed(outline))
    return tuple(Rect(width - r.x1, r.y0, width - r.x0, r.y1) for r in rects), mirrored


def rect_around(center: Vec2, width: float, depth: float, yaw_deg: float) -> Rect:
    """The axis-aligned rectangle round a turned footprint."""
    yaw = math.radians(yaw_deg)
    c, s = abs(math.cos(yaw)), abs(math.sin(yaw))
    half_x, half_y = (c * width + s * depth) / 2, (s * width + c * depth) / 2
    x, y = center
    return Rect(x - half_x, y - half_y, x + half_x, y + half_y)
