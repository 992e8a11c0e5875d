"""Where things go: footprints that stay inside the room, apart, and clear of doors and windows."""

from __future__ import annotations

from dataclasses import dataclass, field

from luxcore.rooms.dice import Rng, between
from luxcore.rooms.model import Part
from luxcore.rooms.piece import Piece, Top, moved, placed
from luxcore.rooms.plan import FloorPlan, Rect, Wall, rect_around
from luxcore.rooms.shapes import Vec2, Vec3
from luxcore.rooms.shell import Hole

DOOR_CLEARANCE_M = 0.9


@dataclass(frozen=True)
class Placed:
    """A piece in the room: where its footprint's centre is, its turn, the space it takes."""

    piece: Piece
    at: Vec2
    yaw_deg: float
    rect: Rect

    @property
    def parts(self) -> tuple[Part, ...]:
        return placed(self.piece.parts, (*self.at, 0.0), self.yaw_deg)

    def tops(self) -> list[tuple[Top, Vec3]]:
        """Free surfaces, each with the world position of its centre."""
        return [
            (t, moved((*t.center, t.z), (*self.at, 0.0), self.yaw_deg)) for t in self.piece.tops
        ]

    def beside(self, dx: float, dy: float) -> Vec2:
        """A point in this piece's frame, in the world."""
        x, y, _ = moved((dx, dy, 0.0), (*self.at, 0.0), self.yaw_deg)
        return (x, y)


@dataclass
class Layout:
    """What has been placed so far."""

    plan: FloorPlan
    holes: tuple[Hole, ...]
    placed: list[Placed] = field(default_factory=list)
    hung: dict[int, list[tuple[float, float]]] = field(default_factory=dict)
    """Stretches of wall (from, to) that carry pictures, mirrors, lamps, tall furniture."""

    def fits(self, rect: Rect, gap: float = 0.02) -> bool:
        """Inside the room, apart from furniture, and not before a door."""
        if not self.plan.holds(rect):
            return False
        if any(rect.grown(gap).overlap(p.rect) > 1e-6 for p in self.placed):
            return False
        return all(rect.overlap(zone) <= 1e-6 for zone in self._door_zones())

    def against_wall(
        self, rng: Rng, piece: Piece, *, tries: int = 30, gap: float = 0.03
    ) -> Placed | None:
        """Back to a wall, tall things not before windows; None when nothing fits."""
        for _ in range(tries):
            number = int(rng.integers(len(self.plan.walls)))
            wall = self.plan.walls[number]
            if wall.length < piece.width + 0.1:
                continue
            along = between(rng, piece.width / 2 + 0.03, wall.length - piece.width / 2 - 0.03)
            found = self._at_wall(wall, number, along, piece, gap)
            if found is not None:
                return found
        return None

    def _at_wall(
        self, wall: Wall, number: int, along: float, piece: Piece, gap: float
    ) -> Placed | None:
        low, high = along - piece.width / 2, along + piece.width / 2
        at = wall.point(along, piece.depth / 2 + gap)
        rect = rect_around(at, piece.width, piece.depth, wall.yaw_deg)
        blocked = self.window_between(number, low, high, piece.height)
        if blocked or not self.fits(rect) or piece.height > self._headroom(rect) - 0.05:
            return None
        found = Placed(piece, at, wall.yaw_deg, rect)
        self.placed.append(found)
        if piece.height > 1.1:
            self.hung.setdefault(number, []).append((low, high))
        return found

    def in_the_open(self, piece: Piece, at: Vec2, yaw_deg: float) -> Placed | None:
        """At a given place and turn; None when it does not fit."""
        rect = rect_around(at, piece.width, piece.depth, yaw_deg)
        if not self.fits(rect, 0.0) or piece.height > self._headroom(rect) - 0.05:
            return None
        found = Placed(piece, at, yaw_deg, rect)
        self.placed.append(found)
        return found

    def on_wall(self, rng: Rng, width: float, low: float, high: float) -> tuple[int, float] | None:
        """A free stretch of wall between two heights: (wall, centre along it)."""
        for _ in range(20):
            number = int(rng.integers(len(self.plan.walls)))
            wall = self.plan.walls[number]
            if wall.length < width + 0.3:
                continue
            along = between(rng, width / 2 + 0.12, wall.length - width / 2 - 0.12)
            a, b = along - width / 2 - 0.05, along + width / 2 + 0.05
            taken = any(a < end and b > start for start, end in self.hung.get(number, ()))
            headroom = min(self.plan.ceiling_at(wall.point(x)[1]) for x in (along, a, b))
            if taken or high > headroom - 0.05 or self._crosses_hole(number, a, b, low, high):
                continue
            self.hung.setdefault(number, []).append((a, b))
            return number, along
        return None

    def window_between(self, number: int, low: float, high: float, top: float) -> bool:
        """Whether something of height `top` would stand before a window."""
        return any(
            h.wall == number
            and h.kind == "window"
            and low < h.right
            and high > h.left
            and top > h.sill + 0.25
            for h in self.holes
        )

    def _crosses_hole(self, number: int, a: float, b: float, low: float, high: float) -> bool:
        return any(
            h.wall == number
            and a < h.right + 0.25
            and b > h.left - 0.25
            and low < h.sill + h.height + 0.1
            and high > h.sill - 0.1
            for h in self.holes
        )

    def _headroom(self, rect: Rect) -> float:
        return min(self.plan.ceiling_at(rect.y0), self.plan.ceiling_at(rect.y1))

    def _door_zones(self) -> list[Rect]:
        zones = []
        for hole in self.holes:
            if hole.kind == "door":
                wall = self.plan.walls[hole.wall]
                at = wall.point(hole.left + hole.width / 2, DOOR_CLEARANCE_M / 2)
                zones.append(rect_around(at, hole.width, DOOR_CLEARANCE_M, wall.yaw_deg))
        return zones
