"""Shelves with books, sideboards, wardrobes, kitchen runs, television stands."""

from __future__ import annotations

import math

from luxcore.rooms.dice import Rng, between, chance, pick
from luxcore.rooms.model import Part
from luxcore.rooms.palette import Palette, tone
from luxcore.rooms.piece import Piece, Top, block, part
from luxcore.rooms.shapes import Ellipsoid, Lathe, cylinder


def book_colors(rng: Rng, palette: Palette, count: int = 6) -> list[str]:
    """Covers of a few colours, shared by a shelf."""
    return [palette.new("paper", tone(rng, (0.1, 0.85), (0.15, 0.85))) for _ in range(count)]


def bookshelf(rng: Rng, palette: Palette) -> Piece:
    """Boards, and rows of books with gaps and things between."""
    width, depth, high = between(rng, 0.6, 1.3), between(rng, 0.26, 0.34), between(rng, 1.1, 2.1)
    wood, shelves = palette.wood(), int(high / 0.36)
    pitch = (high - 0.08) / shelves
    colors = book_colors(rng, palette)
    parts = [
        block("side", wood, (0.025, depth, high), (s * (width - 0.025) / 2, 0, 0)) for s in (-1, 1)
    ]
    parts.append(block("back", wood, (width, 0.012, high), (0, -depth / 2 + 0.006, 0)))
    for k in range(shelves + 1):
        z = 0.05 + k * pitch
        parts.append(block("board", wood, (width - 0.05, depth, 0.022), (0, 0, z)))
        if k < shelves:
            parts += _books(rng, colors, palette, width - 0.06, depth, z + 0.022, pitch - 0.06)
    return Piece(
        "bookshelf",
        tuple(parts),
        width,
        depth,
        high + 0.03,
        (Top((0, 0), width - 0.1, depth - 0.06, round(0.072 + shelves * pitch, 4)),),
    )


def _books(
    rng: Rng, colors: list[str], palette: Palette, width: float, depth: float, z: float, room: float
) -> list[Part]:
    parts: list[Part] = []
    x = -width / 2 + 0.01
    while x < width / 2 - 0.06:
        if chance(rng, 0.07):
            x += between(rng, 0.05, 0.16)
            continue
        if chance(rng, 0.05) and x < width / 2 - 0.2:
            parts.append(vase(rng, palette, (x + 0.08, 0.02, z), min(room * 0.8, 0.22)))
            x += 0.17
            continue
        thick, tall = between(rng, 0.018, 0.048), room * between(rng, 0.62, 0.97)
        deep = depth * between(rng, 0.55, 0.8)
        parts.append(
            block(
                "book",
                pick(rng, colors),
                (thick - 0.001, deep, tall),
                (x + thick / 2, -depth / 2 + 0.02 + deep / 2, z),
            )
        )
        x += thick
    return parts


def vase(rng: Rng, palette: Palette, at: tuple[float, float, float], high: float) -> Part:
    """A turned pot."""
    r = high * between(rng, 0.22, 0.4)
    neck = between(rng, 0.3, 0.7)
    profile = (
        (0.0, 0.0),
        (0.55 * r, 0.0),
        (r, 0.35 * high),
        (0.8 * r, 0.65 * high),
        (neck * r, 0.85 * high),
        (neck * r * 1.2, high),
        (0.0, high - 0.01),
    )
    material = palette.new(
        "ceramic", tone(rng, (0.0, 0.7), (0.2, 0.9)), roughness=between(rng, 0.15, 0.6)
    )
    return part("vase", Lathe(profile, 20), material, at, smooth=True)


def cabinet(
    rng: Rng, palette: Palette, name: str, width: float, depth: float, high: float, doors: int
) -> Piece:
    """A box with doors or drawers in a row, handles and a plinth or legs."""
    wood = pick(rng, (palette.wood(), "white_metal"), (0.7, 0.3))
    handle, foot = palette.metal(), between(rng, 0.05, 0.16)
    parts = [
        block("plinth", "black", (width - 0.1, depth - 0.1, foot), (0, 0, 0)),
        block("body", wood, (width, depth, high - foot), (0, 0, foot), 0.005),
    ]
    pitch = width / doors
    stacked = chance(rng, 0.35)
    for k in range(doors):
        x = -width / 2 + (k + 0.5) * pitch
        rows = 3 if stacked and k == 0 else 1
        tall = (high - foot - 0.02) / rows
        for r in range(rows):
            z = foot + 0.01 + r * tall
            parts.append(
                block("front", wood, (pitch - 0.012, 0.02, tall - 0.012), (x, depth / 2, z), 0.005)
            )
            bar = (0.1, 0.02, 0.012) if rows > 1 else (0.012, 0.02, 0.14)
            dx = 0.0 if rows > 1 else (pitch / 2 - 0.05) * (1 if k % 2 == 0 else -1)
            parts.append(block("handle", handle, bar, (x + dx, depth / 2 + 0.02, z + tall * 0.55)))
    top = Top((0, 0), width - 0.1, depth - 0.08, high)
    return Piece(name, tuple(parts), width, depth, high, (top,) if high < 1.4 else ())


def sideboard(rng: Rng, palette: Palette) -> Piece:
    """Low and long."""
    width = between(rng, 1.1, 1.9)
    return cabinet(
        rng, palette, "sideboard", width, 0.42, between(rng, 0.62, 0.85), int(width / 0.45)
    )


def wardrobe(rng: Rng, palette: Palette) -> Piece:
    """Tall."""
    width = between(rng, 0.9, 1.8)
    return cabinet(
        rng, palette, "wardrobe", width, 0.58, between(rng, 1.9, 2.2), max(2, int(width / 0.5))
    )


def dresser(rng: Rng, palette: Palette) -> Piece:
    """Drawers at hip height."""
    return cabinet(
        rng, palette, "dresser", between(rng, 0.8, 1.2), 0.45, between(rng, 0.75, 0.95), 2
    )


def media_unit(rng: Rng, palette: Palette) -> Piece:
    """A low cabinet with a television on it."""
    base = cabinet(
        rng, palette, "media_unit", between(rng, 1.2, 1.8), 0.4, between(rng, 0.4, 0.55), 3
    )
    width = between(rng, 0.9, 1.25)
    screen = palette.new("screen", (0.008, 0.008, 0.01), roughness=0.1)
    z = base.height
    parts = [
        *base.parts,
        block("stand", "black", (0.4, 0.2, 0.02), (0, -0.05, z)),
        block("bezel", "black", (width, 0.04, width * 0.57), (0, -0.06, z + 0.06)),
        block("screen", screen, (width - 0.02, 0.004, width * 0.57 - 0.02), (0, -0.038, z + 0.07)),
    ]
    return Piece("media_unit", tuple(parts), base.width, base.depth, z + 0.1 + width * 0.57)


def kitchen_run(rng: Rng, palette: Palette, width: float) -> Piece:
    """Base units, a worktop with a sink and a hob, a splashback of tiles, wall units."""
    base = cabinet(rng, palette, "kitchen", width, 0.6, 0.86, max(2, int(width / 0.55)))
    worktop = palette.new(
        "stone",
        pick(rng, ((0.7, 0.68, 0.65), (0.1, 0.1, 0.1), (0.45, 0.3, 0.18))),
        (0.3, 0.29, 0.28),
        0.2,
        0.4,
    )
    tiles = palette.new("brick", tone(rng, (0.0, 0.5), (0.5, 0.95)), (0.6, 0.59, 0.57), 0.15, 0.08)
    parts = [
        *base.parts,
        block("worktop", worktop, (width + 0.02, 0.63, 0.04), (0, 0.01, 0.86), 0.004),
        block("splashback", tiles, (width, 0.01, 0.5), (0, -0.295, 0.9)),
        block("hob", "black", (0.56, 0.48, 0.008), (width * 0.22, 0, 0.9)),
        block("sink", "steel", (0.5, 0.4, 0.012), (-width * 0.22, 0, 0.895)),
        part("tap", cylinder(0.014, 0.26), "steel", (-width * 0.22, -0.22, 0.9), smooth=True),
        part(
            "spout",
            cylinder(0.012, 0.16),
            "steel",
            (-width * 0.22, -0.22, 1.15),
            (-90.0, 0, 0),
            True,
        ),
    ]
    if chance(rng, 0.75):
        upper = cabinet(rng, palette, "upper", width, 0.34, 0.6, max(2, int(width / 0.5)))
        for p in upper.parts:
            x, y, z = p.position
            parts.append(
                part(p.name, p.shape, p.material, (x, y - 0.13, round(z + 1.4, 4)), p.rotation_deg)
            )
    return Piece(
        "kitchen", tuple(parts), width, 0.64, 2.0, (Top((0, 0.05), width * 0.3, 0.4, 0.9),)
    )


def plant(rng: Rng, palette: Palette) -> Piece:
    """A pot with a bush, a palm or a rubber tree of flat leaves."""
    size = between(rng, 0.14, 0.2)
    high = between(rng, 0.7, 1.6)
    pot = Lathe(
        (
            (0.0, 0.0),
            (size * 0.75, 0.0),
            (size, size * 1.7),
            (size * 0.9, size * 1.7),
            (size * 0.85, size * 1.55),
            (0.0, size * 1.55),
        ),
        24,
    )
    material = palette.new("ceramic", tone(rng, (0.0, 0.6), (0.2, 0.9)), roughness=0.5)
    parts = [part("pot", pot, material, smooth=True)]
    stem = cylinder(0.012, high * 0.6, size * 1.5)
    parts.append(part("stem", stem, palette.wood(), smooth=True))
    length = between(rng, 0.12, 0.3)
    for _ in range(int(rng.integers(16, 34))):
        z = between(rng, size * 1.7 + 0.1, high)
        out = between(rng, 0.03, 0.26)
        yaw = between(rng, 0.0, 360.0)
        leaf = Ellipsoid((length / 2, length / 5, 0.006), 10)
        at = (out * math.cos(math.radians(yaw)), out * math.sin(math.radians(yaw)), z)
        parts.append(
            part(
                "leaf", leaf, "leaf", at, (between(rng, -25, 25), between(rng, -60, 15), yaw), True
            )
        )
    return Piece("plant", tuple(parts), 0.5, 0.5, high)
