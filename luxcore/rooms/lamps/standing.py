"""Floor and table lamps: they stand on the origin."""

from __future__ import annotations

import math
from itertools import pairwise

from luxcore.rooms.dice import Rng, between, pick
from luxcore.rooms.lamps.design import Design, LampPiece, glow, shade, solid
from luxcore.rooms.model import Part
from luxcore.rooms.palette import Palette
from luxcore.rooms.shapes import Ellipsoid, Lathe, cylinder, disc


def _pole(palette: Palette, high: float, foot: float = 0.14) -> list[Part]:
    metal = palette.metal()
    base = Lathe(((0.0, 0.0), (foot, 0.0), (foot, 0.018), (0.02, 0.03), (0.0, 0.03)), 24)
    return [solid("foot", base, metal), solid("pole", cylinder(0.011, high, 0.02, 10), metal)]


def floor_shade(rng: Rng, palette: Palette) -> LampPiece:
    """The classic: a cloth shade on a pole."""
    high, r, tall = between(rng, 1.3, 1.6), between(rng, 0.18, 0.25), between(rng, 0.22, 0.34)
    side, up = between(rng, 0.35, 0.6), between(rng, 0.1, 0.25)
    parts = [
        *_pole(palette, high - tall / 2),
        *shade(r, r * between(rng, 0.6, 0.95), high - tall, high, side, 1 - side - up, up),
    ]
    return LampPiece("floor_shade", tuple(parts), (), high, r)


def torchiere(rng: Rng, palette: Palette) -> LampPiece:
    """An opaque dish that lights the ceiling."""
    high, r = between(rng, 1.6, 1.85), between(rng, 0.12, 0.19)
    dish = Lathe(((0.0, high - 0.1), (r * 0.5, high - 0.08), (r, high)), 24)
    parts = [
        *_pole(palette, high - 0.1),
        solid("dish", dish, palette.metal()),
        glow("mouth", disc(r * 0.93, high - 0.015, up=True), 1.0),
    ]
    return LampPiece("torchiere", tuple(parts), (), high, r)


def column(rng: Rng, palette: Palette) -> LampPiece:
    """A tall paper column."""
    high, r = between(rng, 0.8, 1.4), between(rng, 0.1, 0.17)
    parts = [
        solid("foot", cylinder(r, 0.05), palette.wood()),
        glow("paper", cylinder(r * 0.95, high - 0.05, 0.05), 1.0),
    ]
    return LampPiece("column", tuple(parts), (), high, r)


def tripod(rng: Rng, palette: Palette) -> LampPiece:
    """Three wooden legs and a drum."""
    high, r, tall = between(rng, 1.3, 1.55), between(rng, 0.2, 0.27), between(rng, 0.2, 0.3)
    wood, under = palette.wood(), high - tall
    lean = math.degrees(math.atan2(0.24, under))
    length = math.hypot(0.24, under)
    parts = [
        solid("leg", cylinder(0.015, length, -length, 8), wood, (0, 0, under), (0, lean, yaw))
        for yaw in (90.0, 210.0, 330.0)
    ]
    side = between(rng, 0.4, 0.6)
    parts += shade(r, r, under, high, side, 0.8 - side, 0.2)
    return LampPiece("tripod", tuple(parts), (), high, 0.26)


def arc(rng: Rng, palette: Palette) -> LampPiece:
    """A bow with a dome that hangs over the room (towards +y)."""
    metal, reach, high = palette.metal(), between(rng, 0.7, 1.0), between(rng, 1.65, 1.85)
    parts = [
        solid("foot", cylinder(0.16, 0.05), metal),
        solid("pole", cylinder(0.014, 1.2, 0.03, 10), metal),
    ]
    steps = 7
    points = [
        (
            reach / 2 * (1 - math.cos(math.pi * k / steps)),
            1.2 + (high - 1.2) * math.sin(math.pi * k / steps),
        )
        for k in range(steps + 1)
    ]
    for (y0, z0), (y1, z1) in pairwise(points):
        lean = math.degrees(math.atan2(y1 - y0, z1 - z0))
        rod = cylinder(0.012, math.hypot(y1 - y0, z1 - z0), 0.0, 8)
        parts.append(solid("bow", rod, metal, (0, round(y0, 4), round(z0, 4)), (-lean, 0, 0)))
    r = between(rng, 0.13, 0.18)
    dome = Lathe(((r, -r * 0.8), (r * 0.8, -r * 0.25), (0.0, 0.0)), 24)
    at = (0.0, round(reach, 4), 1.2)
    parts += [
        solid("hood", dome, metal, at),
        glow("mouth", disc(r * 0.92, -r * 0.72, up=False), 1.0, at),
    ]
    return LampPiece("arc", tuple(parts), (), high, 0.2)


def reading(rng: Rng, palette: Palette) -> LampPiece:
    """A pole with a tilted conical head."""
    high, metal = between(rng, 1.25, 1.5), palette.metal()
    lean = between(rng, 20, 50)
    head = Lathe(((0.085, -0.16), (0.03, 0.0), (0.0, 0.01)), 24)
    at, turn = (0.0, 0.06, high), (lean, 0.0, 0.0)
    parts = [
        *_pole(palette, high),
        solid("head", head, metal, at, turn),
        glow("mouth", disc(0.076, -0.145, up=False), 1.0, at, turn),
    ]
    return LampPiece("reading", tuple(parts), (), high + 0.05, 0.16)


def table_shade(rng: Rng, palette: Palette) -> LampPiece:
    """A turned base and a cloth shade."""
    body, r = between(rng, 0.16, 0.3), between(rng, 0.11, 0.17)
    tall, wide = between(rng, 0.15, 0.23), between(rng, 0.05, 0.09)
    base = palette.new("ceramic", palette.accent(), roughness=between(rng, 0.1, 0.5))
    turned = Lathe(
        (
            (0.0, 0.0),
            (wide, 0.0),
            (wide * between(rng, 0.8, 1.2), body * 0.4),
            (0.02, body * 0.9),
            (0.012, body + 0.05),
            (0.0, body + 0.05),
        ),
        24,
    )
    side, up = between(rng, 0.35, 0.6), between(rng, 0.1, 0.25)
    low = body + 0.01
    parts = [
        solid("base", turned, base),
        *shade(r, r * between(rng, 0.55, 0.95), low, low + tall, side, 1 - side - up, up),
    ]
    return LampPiece("table_shade", tuple(parts), (), low + tall, r)


def desk_arm(rng: Rng, palette: Palette) -> LampPiece:
    """Two arms and a tilted cone: a work light."""
    metal = palette.new("ceramic", palette.accent(), roughness=0.3)
    low, up = between(rng, 0.2, 0.28), between(rng, 0.2, 0.28)
    elbow = (0.0, -0.1, low)
    head = (0.0, round(-0.1 + up * 0.75, 4), round(low + up * 0.55, 4))
    parts = [
        solid("foot", cylinder(0.08, 0.02), metal),
        solid(
            "arm",
            cylinder(0.008, math.hypot(0.1, low), 0.0, 8),
            metal,
            (0, 0, 0.01),
            (math.degrees(math.atan2(0.1, low)), 0, 0),
        ),
        solid(
            "arm",
            cylinder(0.008, math.hypot(0.75, 0.55) * up, 0.0, 8),
            metal,
            elbow,
            (-math.degrees(math.atan2(0.75, 0.55)), 0, 0),
        ),
    ]
    cone = Lathe(((0.075, -0.11), (0.03, 0.0), (0.0, 0.015)), 24)
    turn = (between(rng, -10, 30), 0.0, 0.0)
    parts += [
        solid("head", cone, metal, head, turn),
        glow("mouth", disc(0.068, -0.1, up=False), 1.0, head, turn),
    ]
    return LampPiece("desk_arm", tuple(parts), (), low + up, 0.12)


def table_globe(rng: Rng, palette: Palette) -> LampPiece:
    """A ball on a low foot."""
    r = between(rng, 0.07, 0.13)
    parts = (
        solid("foot", cylinder(r * 0.6, 0.04), palette.metal()),
        glow("globe", Ellipsoid((r, r, r), 24), 1.0, (0, 0, 0.03 + r)),
    )
    return LampPiece("table_globe", parts, (), 0.03 + 2 * r, r)


def mushroom(rng: Rng, palette: Palette) -> LampPiece:
    """A glowing cap on a stem."""
    r, high = between(rng, 0.1, 0.17), between(rng, 0.22, 0.36)
    cap = Lathe(
        ((r, high - r * 0.7), (r * 0.92, high - r * 0.3), (r * 0.55, high - r * 0.06), (0.0, high)),
        28,
    )
    stem = Lathe(((0.0, 0.0), (r * 0.6, 0.0), (r * 0.25, high * 0.3), (r * 0.22, high * 0.8)), 20)
    parts = (
        solid("stem", stem, palette.metal()),
        glow("cap", cap, 0.6),
        glow("mouth", disc(r * 0.96, high - r * 0.68, up=False), 0.4),
    )
    return LampPiece("mushroom", parts, (), high, r)


def bare_bulb(rng: Rng, palette: Palette) -> LampPiece:
    """A bulb in a socket on a block."""
    r, high = between(rng, 0.03, 0.05), between(rng, 0.08, 0.16)
    parts = (
        solid("block", cylinder(0.05, high), palette.wood()),
        solid("socket", cylinder(0.018, 0.04, high), "black"),
        glow("bulb", Ellipsoid((r, r, r * 1.25), 20), 1.0, (0, 0, round(high + 0.035 + r, 4))),
    )
    return LampPiece("bare_bulb", parts, (), high + 0.04 + 2.2 * r, 0.05)


def draw_floor(rng: Rng, palette: Palette) -> LampPiece:
    """One of the floor designs."""
    designs: tuple[Design, ...] = (floor_shade, torchiere, column, tripod, arc, reading)
    return pick(rng, designs, (0.28, 0.16, 0.14, 0.16, 0.12, 0.14))(rng, palette)


def draw_table(rng: Rng, palette: Palette) -> LampPiece:
    """One of the table designs."""
    designs: tuple[Design, ...] = (table_shade, desk_arm, table_globe, mushroom, bare_bulb)
    return pick(rng, designs, (0.4, 0.16, 0.16, 0.16, 0.12))(rng, palette)
