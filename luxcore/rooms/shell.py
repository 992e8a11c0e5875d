"""Floor, ceiling, walls with holes, skirting, windows, doors."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from luxcore.rooms.dice import Rng, between, chance, pick
from luxcore.rooms.model import Opening, Part
from luxcore.rooms.palette import Palette, lighter, tone
from luxcore.rooms.piece import placed
from luxcore.rooms.plan import WALL_THICKNESS_M, FloorPlan, Wall
from luxcore.rooms.shapes import Box, Drape, Prism, Vec3, cylinder

DOOR_WIDTH_M, DOOR_HEIGHT_M = 0.9, 2.05


@dataclass(frozen=True)
class Hole:
    """A window or door in a wall: from `left` along the wall, from `sill` up."""

    wall: int
    left: float
    width: float
    sill: float
    height: float
    kind: str

    @property
    def right(self) -> float:
        return self.left + self.width


@dataclass(frozen=True)
class Shell:
    """The empty room."""

    parts: tuple[Part, ...]
    openings: tuple[Opening, ...]
    holes: tuple[Hole, ...]
    """Windows are through the wall; doors are closed leaves on it."""


def build_shell(rng: Rng, plan: FloorPlan, palette: Palette) -> Shell:
    """Everything that does not move."""
    holes = _draw_holes(rng, plan)
    feature = int(rng.integers(len(plan.walls)))
    parts: list[Part] = [_floor(plan), *_ceiling(rng, plan, palette)]
    glazed = chance(rng, 0.5)
    if glazed and any(h.kind == "window" for h in holes):
        palette.new("pane", (0.93, 0.95, 0.94))
    for number, wall in enumerate(plan.walls):
        mine = tuple(h for h in holes if h.wall == number)
        material = "wall_feature" if number == feature else "wall"
        parts += _wall(wall, plan, mine, material)
        for hole in mine:
            parts += (
                _window(rng, wall, hole, palette, glazed)
                if hole.kind == "window"
                else (_door(rng, wall, hole, palette))
            )
    openings = tuple(_opening(plan.walls[h.wall], h) for h in holes if h.kind == "window")
    return Shell(tuple(parts), openings, holes)


def _draw_holes(rng: Rng, plan: FloorPlan) -> tuple[Hole, ...]:
    """A door or two, and no to four windows, never two on the same stretch of wall."""
    order = [int(k) for k in rng.permutation(len(plan.walls))]
    long_walls = [k for k in order if plan.walls[k].length > 1.3]
    holes = []
    for wall in long_walls[: 2 if chance(rng, 0.3) else 1]:
        free = plan.walls[wall].length - DOOR_WIDTH_M - 0.3
        left = pick(rng, (0.2, round(0.15 + free, 3)))
        holes.append(Hole(wall, left, DOOR_WIDTH_M, 0.0, DOOR_HEIGHT_M, "door"))
    for wall in long_walls[len(holes) :][: int(pick(rng, (0, 1, 2, 3), (0.12, 0.4, 0.33, 0.15)))]:
        holes.append(_draw_window(rng, plan, wall))
    return tuple(holes)


def _draw_window(rng: Rng, plan: FloorPlan, number: int) -> Hole:
    wall = plan.walls[number]
    lowest = min(plan.ceiling_at(wall.start[1]), plan.ceiling_at(wall.end[1]))
    french = chance(rng, 0.2)
    sill = 0.05 if french else between(rng, 0.75, 1.0)
    width = min(between(rng, 0.9, 2.4), wall.length - 0.5)
    height = min(between(rng, 1.0, 1.5) if not french else 2.1, lowest - sill - 0.15)
    left = between(rng, 0.25, max(0.25, wall.length - width - 0.25))
    return Hole(number, left, width, sill, max(0.5, round(height, 4)), "window")


def _opening(wall: Wall, hole: Hole) -> Opening:
    x, y = wall.point(hole.left + hole.width / 2, -WALL_THICKNESS_M / 2)
    center = (x, y, round(hole.sill + hole.height / 2, 4))
    return Opening("window", center, hole.width, hole.height, wall.inward)


def _floor(plan: FloorPlan) -> Part:
    return Part("floor", Prism(plan.outline, 0.0), "floor")


def _ceiling(rng: Rng, plan: FloorPlan, palette: Palette) -> list[Part]:
    box = plan.bounds
    if plan.ceiling == "slope":
        return [_sloping_ceiling(plan)]
    # Walls are closed by a slab; its lower face is the ceiling.
    slab = Box((box.x1 - box.x0 + 1, box.y1 - box.y0 + 1, 0.1), (0, 0, 0.05))
    middle = ((box.x0 + box.x1) / 2, (box.y0 + box.y1) / 2, plan.height)
    parts = [Part("ceiling", slab, "ceiling", middle)]
    if plan.ceiling == "beams":
        wood = palette.wood()
        step = between(rng, 0.7, 1.1)
        count = int((box.y1 - box.y0) / step)
        for k in range(count):
            beam = Box((box.x1 - box.x0, 0.12, 0.16), (0, 0, -0.08))
            at = (middle[0], round(box.y0 + (k + 0.7) * step, 4), plan.height)
            parts.append(Part("beam", beam, wood, at))
    return parts


def _sloping_ceiling(plan: FloorPlan) -> Part:
    """A slab turned about x, so that its lower face rises from `slope_low` to `height`."""
    box = plan.bounds
    run, rise = box.y1 - box.y0, plan.height - plan.slope_low
    length = math.hypot(run, rise) + 1.0
    slab = Box((box.x1 - box.x0 + 1, length, 0.1), (0, 0, 0.05))
    middle = ((box.x0 + box.x1) / 2, (box.y0 + box.y1) / 2, (plan.slope_low + plan.height) / 2)
    return Part("ceiling", slab, "ceiling", middle, (math.degrees(math.atan2(rise, run)), 0, 0))


def _wall(wall: Wall, plan: FloorPlan, holes: tuple[Hole, ...], material: str) -> list[Part]:
    """Boxes round the windows (doors stay closed, so they need no hole), and skirting boards."""
    top = plan.height + 0.1
    t = WALL_THICKNESS_M
    windows = sorted((h for h in holes if h.kind == "window"), key=lambda h: h.left)
    spans, x = [], -t
    for hole in windows:
        spans.append((x, hole.left, 0.0, top))
        spans.append((hole.left, hole.right, 0.0, hole.sill))
        spans.append((hole.left, hole.right, hole.sill + hole.height, top))
        x = hole.right
    spans.append((x, wall.length + t, 0.0, top))
    parts = [
        Part("wall", Box((b - a, t, d - c), ((a + b) / 2, -t / 2, (c + d) / 2)), material)
        for a, b, c, d in spans
        if b - a > 1e-6 and d - c > 1e-6
    ]
    edges = [
        0.0,
        *(
            e
            for h in sorted(holes, key=lambda h: h.left)
            if h.sill < 0.1
            for e in (h.left, h.right)
        ),
        wall.length,
    ]
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        if b - a > 0.05:
            board = Box((b - a, 0.015, 0.08), ((a + b) / 2, 0.0075, 0.04))
            parts.append(Part("skirting", board, "trim"))
    return _in_wall(wall, parts)


def _in_wall(wall: Wall, parts: list[Part]) -> list[Part]:
    return list(placed(tuple(parts), (*wall.start, 0.0), wall.yaw_deg))


def _frame(hole: Hole, thick: float, deep: float, y: float) -> list[Part]:
    """Four bars round a hole."""
    w, h = hole.width, hole.height
    middle_x, middle_z = hole.left + w / 2, hole.sill + h / 2
    bars = [
        ((w, deep, thick), (middle_x, y, hole.sill + thick / 2)),
        ((w, deep, thick), (middle_x, y, hole.sill + h - thick / 2)),
        ((thick, deep, h), (hole.left + thick / 2, y, middle_z)),
        ((thick, deep, h), (hole.right - thick / 2, y, middle_z)),
    ]
    return [Part("frame", Box(size, at), "trim") for size, at in bars]


def _window(rng: Rng, wall: Wall, hole: Hole, palette: Palette, glazed: bool) -> list[Part]:
    t = WALL_THICKNESS_M
    parts = _frame(hole, 0.06, 0.06, -t / 2)
    middle_x, middle_z = hole.left + hole.width / 2, hole.sill + hole.height / 2
    for k in range(1, int(pick(rng, (1, 2, 3)))):
        x = hole.left + hole.width * k / (2 if hole.width < 1.4 else 3)
        parts.append(Part("mullion", Box((0.04, 0.05, hole.height), (x, -t / 2, middle_z)), "trim"))
    if chance(rng, 0.4):
        z = hole.sill + hole.height * 0.68
        parts.append(Part("transom", Box((hole.width, 0.05, 0.035), (middle_x, -t / 2, z)), "trim"))
    if glazed:
        pane = next(k for k, m in palette.materials.items() if m.kind == "pane")
        sheet = Box((hole.width, 0.004, hole.height), (middle_x, -t / 2, middle_z))
        parts.append(Part("pane", sheet, pane))
    if hole.sill > 0.3:
        shelf = Box((hole.width + 0.12, 0.2, 0.03), (middle_x, -0.02, hole.sill - 0.015))
        parts.append(Part("sill", shelf, "trim"))
    covering = pick(rng, ("none", "curtains", "blinds"), (0.4, 0.42, 0.18))
    if covering == "curtains":
        parts += _curtains(rng, hole, palette)
    elif covering == "blinds":
        parts += _blinds(rng, hole)
    return _in_wall(wall, parts)


def _curtains(rng: Rng, hole: Hole, palette: Palette) -> list[Part]:
    color = tone(rng, (0.0, 0.5), (0.4, 0.9))
    fabric = palette.new("fabric", color, lighter(color, 1.2), scale=0.05)
    top = hole.sill + hole.height + 0.08
    bottom = 0.03 if chance(rng, 0.7) else max(0.03, hole.sill - 0.1)
    width = hole.width * between(rng, 0.22, 0.38)
    folds = max(3, int(width / 0.09))
    cloth = Drape(width, round(top - bottom, 4), folds, 0.07, between(rng, 0.0, 0.5))
    right = hole.right + 0.12 - width
    rod = Part(
        "rod",
        cylinder(0.012, hole.width + 0.5),
        palette.metal(),
        (hole.left - 0.25, 0.09, top),
        (0.0, 90.0, 0.0),
        smooth=True,
    )
    left_cloth = Part("curtain", cloth, fabric, (hole.left - 0.12, 0.09, bottom), smooth=True)
    return [rod, left_cloth, replace(left_cloth, position=(round(right, 4), 0.09, bottom))]


def _blinds(rng: Rng, hole: Hole) -> list[Part]:
    reach = hole.height * between(rng, 0.25, 0.8)
    tilt = between(rng, 15.0, 60.0)
    middle_x, top = hole.left + hole.width / 2, hole.sill + hole.height - 0.07
    slat = Box((hole.width - 0.14, 0.045, 0.002))
    return [
        Part("slat", slat, "trim", (middle_x, -0.03, round(top - k * 0.045, 4)), (tilt, 0.0, 0.0))
        for k in range(int(reach / 0.045))
    ]


def _door(rng: Rng, wall: Wall, hole: Hole, palette: Palette) -> list[Part]:
    """A closed leaf with two panels, a casing and a handle."""
    material = pick(rng, ("trim", palette.wood()))
    x, w, h = hole.left + hole.width / 2, hole.width, hole.height
    parts = [Part("leaf", Box((w - 0.1, 0.04, h), (x, 0.0, h / 2)), material)]
    for z, tall in ((0.55, 0.7), (1.45, 0.8)):
        inset = Box((w * 0.62, 0.02, tall), (x, 0.025, z), 0.008)
        parts.append(Part("panel", inset, material))
    for dx in (-w / 2 + 0.03, w / 2 - 0.03):
        parts.append(
            Part("casing", Box((0.08, 0.05, h + 0.06), (x + dx, 0.02, h / 2 + 0.03)), "trim")
        )
    parts.append(Part("casing", Box((w + 0.02, 0.05, 0.08), (x, 0.02, h + 0.03)), "trim"))
    handle: Vec3 = (x + w * 0.36, 0.07, 1.03)
    parts.append(
        Part("handle", cylinder(0.012, 0.12), palette.metal(), handle, (0, -90.0, 0), smooth=True)
    )
    return _in_wall(wall, parts)
