"""Which lamps a room gets, where they hang or stand, how strong and of what colour they are."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from luxcore.light.blackbody import blackbody_rgb, jitter_hsv
from luxcore.rooms.decor import picture
from luxcore.rooms.dice import Rng, between, chance, pick
from luxcore.rooms.lamps import ceiling, standing, wall
from luxcore.rooms.lamps.design import LampPiece
from luxcore.rooms.layout import Layout
from luxcore.rooms.model import Lamp, LampKind, Part, Spot
from luxcore.rooms.palette import Palette
from luxcore.rooms.piece import Piece, moved, placed
from luxcore.rooms.shapes import Vec3

TEMPERATURE_K = (2700.0, 6500.0)
"""Black-body range of lamps: warm filament bulbs to daylight tubes."""

POWER_W: dict[str, tuple[float, float]] = {
    "ceiling": (18.0, 60.0),
    "wall": (5.0, 18.0),
    "floor": (12.0, 40.0),
    "table": (5.0, 18.0),
}
"""Watts of light by kind; a beam of the same power looks brighter, so spots take the low end."""


@dataclass
class Fittings:
    """The lamps of a room as they are added."""

    lamps: list[Lamp] = field(default_factory=list)
    parts: list[Part] = field(default_factory=list)
    spots: list[Spot] = field(default_factory=list)
    on_tops: set[Vec3] = field(default_factory=set)
    """Centres of the surfaces that carry a table lamp: clutter keeps away from them."""

    def add(
        self,
        rng: Rng,
        kind: LampKind,
        piece: LampPiece,
        at: Vec3,
        yaw_deg: float,
        off_probability: float,
    ) -> None:
        """Fix a lamp in the room, with its power, colour and switch."""
        index = len(self.lamps)
        low, high = POWER_W[kind]
        # Skewed to warm white: most homes are between 2700 and 3500 K.
        share = float(rng.beta(1.5, 2.2))
        temperature = round(TEMPERATURE_K[0] + share * (TEMPERATURE_K[1] - TEMPERATURE_K[0]), 1)
        power = round(low * (high / low) ** float(rng.random()), 3)
        center = _middle(piece, at, yaw_deg)
        self.lamps.append(
            Lamp(
                index,
                f"{kind}_{index}",
                kind,
                piece.design,
                center,
                power,
                temperature,
                _color(rng, temperature),
                not chance(rng, off_probability),
            )
        )
        self.parts += [replace(p, lamp=index) for p in placed(piece.parts, at, yaw_deg)]
        for beam in piece.beams:
            aim = moved(beam.direction, (0.0, 0.0, 0.0), yaw_deg)
            self.spots.append(
                Spot(
                    index,
                    moved(beam.position, at, yaw_deg),
                    aim,
                    beam.cone_deg,
                    beam.blend,
                    beam.radius_m,
                    beam.emits,
                )
            )


def light_room(
    rng: Rng, layout: Layout, palette: Palette, max_lamps: int, off_probability: float
) -> Fittings:
    """One to `max_lamps` lamps; a kind that finds no place is left out, and one always fits."""
    fittings = Fittings()
    wanted = min(max_lamps, int(pick(rng, (1, 2, 3, 4, 5, 6), (0.05, 0.17, 0.28, 0.25, 0.15, 0.1))))
    kinds: list[LampKind] = []
    while len(kinds) < wanted:
        options: tuple[LampKind, ...] = ("ceiling", "wall", "floor", "table")
        kinds.append(pick(rng, options, (0.35, 0.2, 0.22, 0.23)))
    if not any(k == "ceiling" for k in kinds) and chance(rng, 0.55):
        kinds[0] = "ceiling"
    for kind in kinds:
        _ADD[kind](rng, layout, palette, fittings, off_probability)
    if not fittings.lamps:
        _add_ceiling(rng, layout, palette, fittings, off_probability)
    if not any(lamp.on for lamp in fittings.lamps):
        fittings.lamps[0] = replace(fittings.lamps[0], on=True)
    return fittings


def _add_ceiling(
    rng: Rng, layout: Layout, palette: Palette, fittings: Fittings, off: float
) -> None:
    """Over a table, else over the middle of a part of the room, apart from other ceiling lamps."""
    piece = ceiling.draw(rng, palette)
    tables = [p for p in layout.placed if p.piece.name in ("dining_table", "coffee_table")]
    others = [lamp.position for lamp in fittings.lamps if lamp.kind == "ceiling"]
    for _ in range(12):
        rect = pick(rng, layout.plan.rects)
        spread = 0.12 if not others else 0.32
        at = (
            round((rect.x0 + rect.x1) / 2 + (rect.x1 - rect.x0) * between(rng, -spread, spread), 4),
            round((rect.y0 + rect.y1) / 2 + (rect.y1 - rect.y0) * between(rng, -spread, spread), 4),
        )
        over_table = bool(tables) and not others and chance(rng, 0.6)
        if over_table:
            at = tables[0].at
        x, y, z = layout.plan.lift(at)
        if not over_table and z - piece.height < 1.85:
            piece = ceiling.panel(rng, palette)
        if all(math.dist((x, y), o[:2]) > 1.2 for o in others):
            fittings.add(rng, "ceiling", piece, (x, y, z), pick(rng, (0.0, 90.0)), off)
            return


def _add_wall(rng: Rng, layout: Layout, palette: Palette, fittings: Fittings, off: float) -> None:
    piece = wall.draw(rng, palette)
    if piece.design == "picture_light":
        _add_picture_light(rng, layout, palette, fittings, off, piece)
        return
    z = between(rng, 1.55, 1.95)
    half = piece.height / 2 + 0.05
    found = layout.on_wall(rng, max(0.25, 2 * piece.radius), z - half, z + half)
    if found is not None:
        side = layout.plan.walls[found[0]]
        fittings.add(rng, "wall", piece, (*side.point(found[1]), z), side.yaw_deg, off)


def _add_picture_light(
    rng: Rng, layout: Layout, palette: Palette, fittings: Fittings, off: float, piece: LampPiece
) -> None:
    """The lamp and, below it, the picture that it is there for."""
    width = round(2 * piece.radius * between(rng, 1.1, 1.9), 4)
    height = between(rng, 0.35, 0.7)
    middle = between(rng, 1.4, 1.6)
    z = middle + height / 2 + 0.06
    found = layout.on_wall(rng, width, middle - height / 2, z + piece.height)
    if found is not None:
        side = layout.plan.walls[found[0]]
        hung = picture(rng, palette, width, height)
        fittings.parts += placed(hung, (*side.point(found[1]), middle), side.yaw_deg)
        fittings.add(rng, "wall", piece, (*side.point(found[1]), z), side.yaw_deg, off)


def _add_floor(rng: Rng, layout: Layout, palette: Palette, fittings: Fittings, off: float) -> None:
    piece = standing.draw_floor(rng, palette)
    size = 2 * piece.radius + 0.04
    found = layout.against_wall(rng, Piece("floor_lamp", (), size, size, piece.height), gap=0.06)
    if found is not None:
        fittings.add(rng, "floor", piece, (*found.at, 0.0), found.yaw_deg, off)


def _add_table(rng: Rng, layout: Layout, palette: Palette, fittings: Fittings, off: float) -> None:
    piece = standing.draw_table(rng, palette)
    surfaces = [
        (top, at, p.yaw_deg)
        for p in layout.placed
        for top, at in p.tops()
        if at not in fittings.on_tops
        and top.z < 1.3
        and min(top.width, top.depth) > 1.2 * piece.radius
    ]
    if surfaces:
        _, at, yaw = pick(rng, surfaces)
        fittings.on_tops.add(at)
        fittings.add(rng, "table", piece, at, yaw + between(rng, -25, 25), off)


def _color(rng: Rng, temperature_k: float) -> Vec3:
    r, g, b = jitter_hsv(blackbody_rgb(temperature_k), rng).round(5).tolist()
    return (r, g, b)


def _middle(piece: LampPiece, at: Vec3, yaw_deg: float) -> Vec3:
    """The centre of the light: the mean of what emits."""
    glowing = [p for p in piece.parts if p.emits > 0]
    corners = [
        [a + b for a, b in zip(p.position, p.shape.mesh().vertices.mean(axis=0), strict=True)]
        for p in glowing
    ]
    middle = [sum(c) / len(c) for c in zip(*corners, strict=True)]
    return moved((middle[0], middle[1], middle[2]), at, yaw_deg)


_ADD = {"ceiling": _add_ceiling, "wall": _add_wall, "floor": _add_floor, "table": _add_table}
