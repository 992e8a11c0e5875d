"""Lamps on or under the ceiling. z is 0 at the ceiling and negative below."""

from __future__ import annotations

import math

from luxcore.rooms.dice import Rng, between, pick
from luxcore.rooms.lamps.design import Beam, Design, LampPiece, glow, hood, shade, solid
from luxcore.rooms.model import Part
from luxcore.rooms.palette import Palette
from luxcore.rooms.shapes import Box, Ellipsoid, Lathe, cylinder, disc


def _cord(rng: Rng, palette: Palette, drop: float) -> list[Part]:
    metal = palette.metal()
    return [
        solid("rose", cylinder(0.05, 0.025, -0.025), metal),
        solid("cord", cylinder(0.006, drop, -drop, 8), "black"),
    ]


def dome(rng: Rng, palette: Palette) -> LampPiece:
    """Opaque metal dome: a cone."""
    drop, r = between(rng, 0.35, 0.75), between(rng, 0.15, 0.28)
    profile = (
        (r, -drop - r * 0.75),
        (r * 0.93, -drop - r * 0.4),
        (r * 0.6, -drop - r * 0.1),
        (0.03, -drop),
        (0.0, -drop),
    )
    material = palette.new("ceramic", palette.accent(), roughness=0.3)
    parts = [*_cord(rng, palette, drop), *hood(profile, material, -drop - r * 0.68, r * 0.94)]
    return LampPiece("dome", tuple(parts), (), drop + r * 0.75, r)


def globe(rng: Rng, palette: Palette) -> LampPiece:
    """A sphere of milk glass: light to every side."""
    drop, r = between(rng, 0.2, 0.7), between(rng, 0.1, 0.2)
    ball = glow("globe", Ellipsoid((r, r, r), 24), 1.0, (0.0, 0.0, -drop - r))
    return LampPiece("globe", (*_cord(rng, palette, drop), ball), (), drop + 2 * r, r)


def lantern(rng: Rng, palette: Palette) -> LampPiece:
    """A flattened paper lantern."""
    drop, r = between(rng, 0.25, 0.6), between(rng, 0.18, 0.3)
    tall = r * between(rng, 0.55, 1.1)
    ball = glow("paper", Ellipsoid((r, r, tall), 28), 1.0, (0.0, 0.0, -drop - tall))
    return LampPiece("lantern", (*_cord(rng, palette, drop), ball), (), drop + 2 * tall, r)


def drum(rng: Rng, palette: Palette) -> LampPiece:
    """A cloth drum: side, below and a little above."""
    drop, r, tall = between(rng, 0.3, 0.6), between(rng, 0.18, 0.3), between(rng, 0.15, 0.28)
    side = between(rng, 0.35, 0.6)
    parts = shade(r, r * between(rng, 0.8, 1.0), -drop - tall, -drop, side, 0.85 - side, 0.15)
    return LampPiece("drum", (*_cord(rng, palette, drop), *parts), (), drop + tall, r)


def panel(rng: Rng, palette: Palette) -> LampPiece:
    """A flat panel or disc on the ceiling."""
    if rng.random() < 0.5:
        r = between(rng, 0.15, 0.25)
        body = solid("rim", cylinder(r + 0.012, 0.05, -0.05), palette.metal())
        face = glow("face", cylinder(r, 0.03, -0.075), 1.0)
        return LampPiece("panel", (body, face), (), 0.08, r)
    w, d = between(rng, 0.3, 0.6), between(rng, 0.3, 0.6)
    body = solid("rim", Box((w + 0.03, d + 0.03, 0.04), (0, 0, -0.02)), "white_metal")
    face = glow("face", Box((w, d, 0.02), (0, 0, -0.045)), 1.0)
    return LampPiece("panel", (body, face), (), 0.06, max(w, d) / 2)


def chandelier(rng: Rng, palette: Palette) -> LampPiece:
    """Arms with small globes: a cluster that is one lamp."""
    drop, arms = between(rng, 0.35, 0.6), int(rng.integers(3, 7))
    reach, r, metal = between(rng, 0.2, 0.34), between(rng, 0.035, 0.06), palette.metal()
    upward = rng.random() < 0.5
    parts = [
        *_cord(rng, palette, drop),
        solid("hub", Ellipsoid((0.04, 0.04, 0.05)), metal, (0.0, 0.0, -drop)),
    ]
    for k in range(arms):
        yaw = 360.0 * k / arms
        c, s = math.cos(math.radians(yaw)), math.sin(math.radians(yaw))
        parts.append(
            solid("arm", cylinder(0.009, reach, 0.0, 8), metal, (0.0, 0.0, -drop), (0.0, 90.0, yaw))
        )
        z = -drop + (r if upward else -r)
        bulb = Ellipsoid((r, r, r), 16)
        parts.append(
            glow("bulb", bulb, 1.0 / arms, (round(c * reach, 4), round(s * reach, 4), round(z, 4)))
        )
    return LampPiece("chandelier", tuple(parts), (), drop + 2 * r, reach + r)


def spots(rng: Rng, palette: Palette) -> LampPiece:
    """A bar with two to four heads aimed at walls and furniture."""
    heads, metal = int(rng.integers(2, 5)), palette.metal()
    length = 0.28 * heads
    parts = [solid("bar", Box((length, 0.05, 0.03), (0, 0, -0.015)), metal)]
    beams = []
    for k in range(heads):
        x = (k - (heads - 1) / 2) * 0.28
        tilt, yaw = between(rng, 15, 50), between(rng, 0, 360)
        t, y = math.radians(tilt), math.radians(yaw)
        aim = (math.sin(t) * math.cos(y), math.sin(t) * math.sin(y), -math.cos(t))
        at = (round(x, 4), 0.0, -0.1)
        # A head points along its own -z: lean it by the tilt, towards the yaw.
        turn = (0.0, -tilt, yaw)
        parts.append(solid("head", cylinder(0.04, 0.11, -0.05, 20), metal, at, turn))
        mouth = tuple(round(a + 0.056 * b, 4) for a, b in zip(at, aim, strict=True))
        parts.append(glow("mouth", cylinder(0.034, 0.004, -0.056, 20), 0.1 / heads, at, turn))
        beams.append(
            Beam(
                (mouth[0], mouth[1], mouth[2]),
                aim,
                between(rng, 45, 85),
                between(rng, 0.3, 1.0),
                0.03,
                0.9 / heads,
            )
        )
    return LampPiece("spots", tuple(parts), tuple(beams), 0.2, length / 2)


def linear(rng: Rng, palette: Palette) -> LampPiece:
    """A bar over a table: light from its underside, or all round."""
    drop, length = between(rng, 0.5, 0.9), between(rng, 0.8, 1.3)
    metal, all_round = palette.metal(), rng.random() < 0.4
    parts = [
        solid("cord", cylinder(0.004, drop, -drop, 6), "black", (x, 0.0, 0.0))
        for x in (-length / 3, length / 3)
    ]
    if all_round:
        tube = cylinder(0.03, length, -length / 2, 16)
        parts.append(glow("tube", tube, 1.0, (0.0, 0.0, -drop - 0.03), (0.0, 90.0, 0.0)))
    else:
        parts.append(solid("bar", Box((length, 0.06, 0.06), (0, 0, -drop - 0.03)), metal))
        parts.append(glow("strip", Box((length - 0.04, 0.045, 0.01), (0, 0, -drop - 0.062)), 1.0))
    return LampPiece("linear", tuple(parts), (), drop + 0.07, length / 2)


def bowl(rng: Rng, palette: Palette) -> LampPiece:
    """An opaque bowl that lights the ceiling: indirect."""
    drop, r = between(rng, 0.35, 0.6), between(rng, 0.18, 0.26)
    shell = Lathe(((0.0, -drop - r * 0.6), (r * 0.6, -drop - r * 0.45), (r, -drop)), 28)
    parts = [
        *_cord(rng, palette, drop),
        solid("bowl", shell, palette.metal()),
        glow("mouth", disc(r * 0.95, -drop - 0.02, up=True), 1.0),
    ]
    return LampPiece("bowl", tuple(parts), (), drop + r * 0.6, r)


def draw(rng: Rng, palette: Palette) -> LampPiece:
    """One of the designs."""
    designs: tuple[Design, ...] = (
        dome,
        globe,
        lantern,
        drum,
        panel,
        chandelier,
        spots,
        linear,
        bowl,
    )
    weights = (0.14, 0.14, 0.1, 0.15, 0.13, 0.12, 0.1, 0.06, 0.06)
    return pick(rng, designs, weights)(rng, palette)
