"""Lamps on a wall: the origin is on the wall, +y is into the room."""

from __future__ import annotations

import math

from luxcore.rooms.dice import Rng, between, pick
from luxcore.rooms.lamps.design import Beam, Design, LampPiece, glow, solid
from luxcore.rooms.palette import Palette
from luxcore.rooms.shapes import Box, Ellipsoid, Lathe, Prism, cylinder, disc


def up_down(rng: Rng, palette: Palette) -> LampPiece:
    """A tube open at both ends: two fans of light on the wall, often unequal."""
    r, tall, share = between(rng, 0.04, 0.06), between(rng, 0.16, 0.3), between(rng, 0.1, 0.9)
    y = r + 0.03
    parts = (
        solid("tube", Lathe(((r, -tall / 2), (r, tall / 2)), 20), palette.metal(), (0, y, 0)),
        solid("plate", Box((0.06, 0.03, tall * 0.6), (0, 0.015, 0)), palette.metal()),
        glow("mouth", disc(r * 0.9, tall / 2 - 0.004, up=True), share, (0, y, 0)),
        glow("mouth", disc(r * 0.9, -tall / 2 + 0.004, up=False), 1 - share, (0, y, 0)),
    )
    return LampPiece("up_down", parts, (), tall, r)


def globe(rng: Rng, palette: Palette) -> LampPiece:
    """A ball of milk glass on an arm."""
    r, metal = between(rng, 0.06, 0.1), palette.metal()
    parts = (
        solid("plate", cylinder(0.05, 0.02), metal, (0, 0, 0), (-90.0, 0, 0)),
        solid("arm", cylinder(0.01, 0.1, 0.0, 8), metal, (0, 0, 0), (-90.0, 0, 0)),
        glow("globe", Ellipsoid((r, r, r), 20), 1.0, (0, 0.1 + r, 0)),
    )
    return LampPiece("globe", parts, (), 2 * r, r)


def half_drum(rng: Rng, palette: Palette) -> LampPiece:
    """A half cylinder of cloth against the wall."""
    r, tall = between(rng, 0.09, 0.15), between(rng, 0.18, 0.3)
    side = between(rng, 0.4, 0.7)
    half = Lathe(((r, -tall / 2), (r * 0.85, tall / 2)), 16, 180.0)
    ends = [(x, y) for x, y in _half_circle(r * 0.95)]
    lid = Prism(tuple(ends), 0.002)
    parts = (
        glow("shade", half, side, (0, 0.01, 0)),
        glow("mouth", lid, (1 - side) * 0.6, (0, 0.01, -tall / 2)),
        glow("mouth", lid, (1 - side) * 0.4, (0, 0.01, tall / 2 - 0.004)),
        solid("plate", Box((0.1, 0.012, tall * 0.8), (0, 0.006, 0)), palette.metal()),
    )
    return LampPiece("half_drum", parts, (), tall, r)


def picture_light(rng: Rng, palette: Palette) -> LampPiece:
    """A bar on an arm that lights the wall below: asymmetric."""
    length, out, metal = between(rng, 0.25, 0.5), between(rng, 0.14, 0.22), palette.metal()
    parts = (
        solid("arm", cylinder(0.008, out, 0.0, 8), metal, (0, 0, 0), (-90.0, 0, 0)),
        solid("bar", Box((length, 0.045, 0.035), (0, out, 0.0)), metal),
        glow(
            "strip",
            Box((length - 0.03, 0.03, 0.006)),
            1.0,
            (0, out - 0.008, -0.02),
            (-30.0, 0.0, 0.0),
        ),
    )
    return LampPiece("picture_light", parts, (), 0.08, length / 2)


def bar(rng: Rng, palette: Palette) -> LampPiece:
    """An upright light bar."""
    tall = between(rng, 0.35, 0.7)
    parts = (
        solid("back", Box((0.05, 0.02, tall + 0.03), (0, 0.01, 0)), palette.metal()),
        glow("tube", Box((0.035, 0.03, tall), (0, 0.035, 0)), 1.0),
    )
    return LampPiece("bar", parts, (), tall, 0.03)


def swing_spot(rng: Rng, palette: Palette) -> LampPiece:
    """A small head that throws a beam down into the room."""
    metal = palette.metal()
    at = (0.0, 0.13, 0.0)
    lean = between(rng, 10, 35)
    aim = (0.0, math.sin(math.radians(lean)), -math.cos(math.radians(lean)))
    turn = (lean, 0.0, 0.0)
    parts = (
        solid("plate", cylinder(0.045, 0.015), metal, (0, 0, 0), (-90.0, 0, 0)),
        solid("arm", cylinder(0.009, 0.13, 0.0, 8), metal, (0, 0, 0), (-90.0, 0, 0)),
        solid("head", Lathe(((0.05, -0.08), (0.03, 0.04), (0.0, 0.05)), 20), metal, at, turn),
        glow("mouth", cylinder(0.046, 0.004, -0.086, 20), 0.15, at, turn),
    )
    beam = Beam(
        (0.0, round(at[1] + 0.09 * aim[1], 4), round(0.09 * aim[2], 4)),
        aim,
        between(rng, 60, 110),
        0.8,
        0.03,
        0.85,
    )
    return LampPiece("swing_spot", parts, (beam,), 0.15, 0.06)


def _half_circle(radius: float, count: int = 12) -> list[tuple[float, float]]:
    return [
        (
            round(radius * math.cos(math.pi * k / count), 5),
            round(radius * math.sin(math.pi * k / count), 5),
        )
        for k in range(count + 1)
    ]


def draw(rng: Rng, palette: Palette) -> LampPiece:
    """One of the designs."""
    designs: tuple[Design, ...] = (up_down, globe, half_drum, picture_light, bar, swing_spot)
    return pick(rng, designs, (0.22, 0.22, 0.18, 0.1, 0.14, 0.14))(rng, palette)
