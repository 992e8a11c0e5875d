"""Pictures, mirrors, rugs, and clutter on free surfaces."""

from __future__ import annotations

import math

from luxcore.rooms.dice import Rng, between, chance, pick
from luxcore.rooms.furniture.storage import vase
from luxcore.rooms.model import Part
from luxcore.rooms.palette import Palette, tone
from luxcore.rooms.piece import Top, block, part
from luxcore.rooms.shapes import Box, Ellipsoid, Lathe, Prism, cylinder


def picture(rng: Rng, palette: Palette, width: float, height: float) -> tuple[Part, ...]:
    """A framed painting, in a wall's frame, centre at the origin."""
    frame = pick(rng, ("black", "trim", palette.wood(), "brass"))
    canvas = palette.new(
        "picture",
        palette.accent(),
        tone(rng, (0.1, 0.9), (0.2, 0.9)),
        scale=between(rng, 0.15, 0.6),
    )
    border = between(rng, 0.015, 0.04)
    parts = [
        part("frame", Box((width, 0.03, height), (0, 0.015, 0)), frame),
        part(
            "canvas", Box((width - 2 * border, 0.008, height - 2 * border), (0, 0.029, 0)), canvas
        ),
    ]
    if chance(rng, 0.4):
        mount = palette.new("paper", (0.75, 0.73, 0.69))
        parts[1] = part(
            "mount", Box((width - 2 * border, 0.006, height - 2 * border), (0, 0.029, 0)), mount
        )
        parts.append(part("canvas", Box((width * 0.6, 0.004, height * 0.6), (0, 0.033, 0)), canvas))
    return tuple(parts)


def mirror(rng: Rng, palette: Palette, width: float, height: float) -> tuple[Part, ...]:
    """A framed mirror, in a wall's frame."""
    glass = palette.new("mirror", (0.86, 0.87, 0.86))
    if chance(rng, 0.4):
        r = min(width, height) / 2
        return (
            part("frame", cylinder(r, 0.02, 0.0, 40), palette.metal(), (0, 0, 0), (-90.0, 0, 0)),
            part("glass", cylinder(r * 0.95, 0.003, 0.02, 40), glass, (0, 0, 0), (-90.0, 0, 0)),
        )
    frame = pick(rng, (palette.wood(), "black", "brass"))
    return (
        part("frame", Box((width, 0.03, height), (0, 0.015, 0)), frame),
        part("glass", Box((width - 0.06, 0.003, height - 0.06), (0, 0.031, 0)), glass),
    )


def rug(rng: Rng, palette: Palette, width: float, depth: float) -> tuple[Part, ...]:
    """A patterned rug with a border, or a round one; centre of the footprint at the origin."""
    color, color2 = tone(rng, (0.1, 0.75), (0.2, 0.75)), tone(rng, (0.05, 0.7), (0.25, 0.85))
    pattern = palette.new("rug", color, color2, scale=between(rng, 0.08, 0.4))
    if chance(rng, 0.2):
        return (part("rug", cylinder(min(width, depth) / 2, 0.012, 0.0, 48), pattern),)
    border = palette.new("carpet", color2)
    return (
        part("rug_border", Box((width, depth, 0.01), (0, 0, 0.005)), border),
        part("rug", Box((width - 0.2, depth - 0.2, 0.012), (0, 0, 0.0065)), pattern),
    )


def clutter(rng: Rng, palette: Palette, top: Top, taken: float = 0.0) -> tuple[Part, ...]:
    """A few small things on a free surface; `taken` metres round its centre stay empty."""
    parts: list[Part] = []
    for _ in range(int(rng.integers(1, 5))):
        x = between(rng, -top.width / 2 + 0.08, max(-top.width / 2 + 0.08, top.width / 2 - 0.08))
        y = between(rng, -top.depth / 2 + 0.06, max(-top.depth / 2 + 0.06, top.depth / 2 - 0.06))
        clear = all(math.dist((x, y), p.position[:2]) > 0.15 for p in parts)
        if not clear or math.hypot(x, y) < taken:
            continue
        parts += _thing(rng, palette, x, y)
    moved = []
    for p in parts:
        px, py, pz = p.position
        at = (round(px + top.center[0], 4), round(py + top.center[1], 4), round(pz + top.z, 4))
        moved.append(part(p.name, p.shape, p.material, at, p.rotation_deg, p.smooth))
    return tuple(moved)


def _thing(rng: Rng, palette: Palette, x: float, y: float) -> list[Part]:
    kind = pick(
        rng,
        ("books", "vase", "bowl", "mug", "frame", "tumbler", "plant"),
        (0.26, 0.2, 0.14, 0.14, 0.1, 0.06, 0.1),
    )
    if kind == "books":
        return _stack(rng, palette, x, y)
    if kind == "vase":
        return [vase(rng, palette, (x, y, 0.0), between(rng, 0.12, 0.3))]
    if kind == "bowl":
        return _bowl(rng, palette, x, y)
    if kind == "frame":
        canvas = palette.new("picture", palette.accent(), (0.6, 0.5, 0.4), scale=0.1)
        turn = (-12.0, 0.0, between(rng, -30, 30))
        return [
            part(
                "photo_frame",
                Box((0.15, 0.012, 0.2), (0, 0, 0.1)),
                palette.wood(),
                (x, y, 0.0),
                turn,
            ),
            part("photo", Box((0.12, 0.004, 0.16), (0, 0.008, 0.1)), canvas, (x, y, 0.0), turn),
        ]
    if kind == "tumbler":
        glass = palette.new("glass", (0.96, 0.98, 0.97))
        walls = Lathe(
            ((0.0, 0.0), (0.033, 0.0), (0.037, 0.11), (0.034, 0.11), (0.03, 0.008), (0.0, 0.008)),
            24,
        )
        return [part("tumbler", walls, glass, (x, y, 0.001), smooth=True)]
    if kind == "plant":
        return _pot(rng, palette, x, y)
    color = palette.new("ceramic", tone(rng, (0.0, 0.8), (0.3, 0.9)), roughness=0.25)
    cup = Lathe(
        ((0.0, 0.0), (0.035, 0.0), (0.04, 0.09), (0.036, 0.09), (0.032, 0.01), (0.0, 0.01)), 20
    )
    return [part("mug", cup, color, (x, y, 0.0), smooth=True)]


def _stack(rng: Rng, palette: Palette, x: float, y: float) -> list[Part]:
    parts, z = [], 0.0
    for _ in range(int(rng.integers(1, 5))):
        thick = between(rng, 0.015, 0.035)
        color = palette.new("paper", tone(rng, (0.1, 0.8), (0.15, 0.85)))
        size = (between(rng, 0.13, 0.2), between(rng, 0.19, 0.27), thick)
        book = block("book", color, size, (x, y, round(z, 4)))
        parts.append(
            part("book", book.shape, color, book.position, (0.0, 0.0, between(rng, -25, 25)))
        )
        z += thick
    return parts


def _bowl(rng: Rng, palette: Palette, x: float, y: float) -> list[Part]:
    r = between(rng, 0.09, 0.15)
    color = palette.new("ceramic", tone(rng, (0.0, 0.6), (0.3, 0.9)), roughness=0.3)
    shell = Lathe(
        (
            (0.0, 0.0),
            (r * 0.5, 0.0),
            (r, r * 0.55),
            (r * 0.94, r * 0.55),
            (r * 0.45, 0.012),
            (0.0, 0.012),
        ),
        28,
    )
    parts = [part("bowl", shell, color, (x, y, 0.0), smooth=True)]
    fruit = palette.new(
        "ceramic",
        pick(rng, ((0.6, 0.22, 0.03), (0.35, 0.5, 0.06), (0.5, 0.05, 0.04))),
        roughness=0.45,
    )
    for k in range(int(rng.integers(0, 5))):
        a = 1.3 * k
        at = (round(x + r * 0.4 * math.cos(a), 4), round(y + r * 0.4 * math.sin(a), 4), r * 0.42)
        parts.append(part("fruit", Ellipsoid((0.036, 0.036, 0.034), 14), fruit, at, smooth=True))
    return parts


def _pot(rng: Rng, palette: Palette, x: float, y: float) -> list[Part]:
    color = palette.new("ceramic", tone(rng, (0.1, 0.7), (0.3, 0.9)), roughness=0.6)
    parts = [part("pot", cylinder(0.05, 0.09), color, (x, y, 0.0), smooth=True)]
    for k in range(9):
        yaw, lean = 40.0 * k, between(rng, 15, 60)
        blade = Prism(
            ((-0.012, 0.0), (0.012, 0.0), (0.004, 0.16), (0.0, 0.18), (-0.004, 0.16)), 0.003
        )
        parts.append(part("blade", blade, "leaf", (x, y, 0.085), (90.0 - lean, 0.0, yaw)))
    return parts
