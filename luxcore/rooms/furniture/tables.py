"""Tables, desks, bedside tables."""

from __future__ import annotations

from luxcore.rooms.dice import Rng, between, chance, pick
from luxcore.rooms.model import Part
from luxcore.rooms.palette import Palette
from luxcore.rooms.piece import Piece, Top, block, part
from luxcore.rooms.shapes import Lathe, cylinder


def table(rng: Rng, palette: Palette, name: str, width: float, depth: float, high: float) -> Piece:
    """A rectangular or round top on four legs, two trestles or a column."""
    wood, thick = palette.wood(), between(rng, 0.022, 0.045)
    base = pick(rng, (wood, palette.metal()))
    top_material = wood if chance(rng, 0.75) else _hard_top(rng, palette)
    under = high - thick
    is_round = chance(rng, 0.35) and abs(width - depth) < 0.5
    if is_round:
        width = depth = round((width + depth) / 2, 3)
        plate = part("top", cylinder(width / 2, thick, under, 40), top_material, smooth=False)
        column = Lathe(
            (
                (0.0, 0.0),
                (0.24 * width + 0.05, 0.0),
                (0.24 * width, 0.025),
                (0.04, 0.06),
                (0.035, under),
                (0.0, under),
            ),
            24,
        )
        parts = [plate, part("column", column, base, smooth=True)]
        free = width * 0.62
        return Piece(name, tuple(parts), width, depth, high, (Top((0, 0), free, free, high),))
    parts = [block("top", top_material, (width, depth, thick), (0, 0, under), 0.006)]
    parts += _underframe(rng, base, width, depth, under)
    return Piece(
        name, tuple(parts), width, depth, high, (Top((0, 0), width - 0.1, depth - 0.1, high),)
    )


def _underframe(rng: Rng, base: str, width: float, depth: float, under: float) -> list[Part]:
    thick = between(rng, 0.035, 0.07)
    x, y = width / 2 - thick, depth / 2 - thick
    legs = [block("leg", base, (thick, thick, under), (a, b, 0)) for a in (-x, x) for b in (-y, y)]
    if chance(rng, 0.5):
        for b in (-y, y):
            legs.append(block("apron", base, (2 * x, 0.02, 0.07), (0, b, under - 0.07)))
    else:
        for a in (-x, x):
            legs.append(block("foot", base, (thick, 2 * y, 0.04), (a, 0, 0)))
    return legs


def _hard_top(rng: Rng, palette: Palette) -> str:
    if chance(rng, 0.5):
        return palette.new(
            "stone",
            pick(rng, ((0.75, 0.73, 0.7), (0.08, 0.08, 0.085))),
            (0.35, 0.33, 0.32),
            0.18,
            0.5,
        )
    return palette.new("ceramic", pick(rng, ((0.8, 0.8, 0.79), (0.03, 0.03, 0.03))), roughness=0.3)


def coffee_table(rng: Rng, palette: Palette) -> Piece:
    """Low, before a sofa."""
    return table(
        rng,
        palette,
        "coffee_table",
        between(rng, 0.7, 1.2),
        between(rng, 0.5, 0.75),
        between(rng, 0.34, 0.45),
    )


def dining_table(rng: Rng, palette: Palette) -> Piece:
    """For four to eight."""
    return table(
        rng,
        palette,
        "dining_table",
        between(rng, 1.1, 1.9),
        between(rng, 0.8, 1.0),
        between(rng, 0.72, 0.77),
    )


def side_table(rng: Rng, palette: Palette) -> Piece:
    """Small, beside a sofa; made to carry a lamp."""
    size = between(rng, 0.4, 0.55)
    return table(rng, palette, "side_table", size, size, between(rng, 0.45, 0.6))


def console(rng: Rng, palette: Palette) -> Piece:
    """Narrow, against a wall."""
    return table(
        rng,
        palette,
        "console",
        between(rng, 0.9, 1.3),
        between(rng, 0.3, 0.38),
        between(rng, 0.76, 0.85),
    )


def desk(rng: Rng, palette: Palette) -> Piece:
    """A work table with a drawer block and, often, a screen."""
    plain = table(rng, palette, "desk", between(rng, 1.1, 1.6), between(rng, 0.6, 0.75), 0.74)
    wood, width, depth = palette.wood(), plain.width, plain.depth
    parts = list(plain.parts)
    x = width / 2 - 0.28
    parts.append(block("drawers", wood, (0.4, depth - 0.12, 0.6), (x, 0, 0.08)))
    for k in range(3):
        parts.append(
            block("front", wood, (0.37, 0.02, 0.17), (x, depth / 2 - 0.05, 0.1 + k * 0.19), 0.005)
        )
        parts.append(
            block(
                "knob", palette.metal(), (0.1, 0.02, 0.012), (x, depth / 2 - 0.03, 0.18 + k * 0.19)
            )
        )
    if chance(rng, 0.7):
        parts += _monitor(rng, palette, 0.74, -depth / 2 + 0.2)
    return Piece(
        "desk",
        tuple(parts),
        width,
        depth,
        0.74,
        (Top((-width * 0.3, 0), width * 0.3, depth - 0.15, 0.74),),
    )


def _monitor(rng: Rng, palette: Palette, z: float, y: float) -> list[Part]:
    width = between(rng, 0.5, 0.62)
    screen = palette.new("screen", (0.012, 0.013, 0.015))
    return [
        block("stand", "black", (0.22, 0.16, 0.012), (0.1, y, z)),
        block("neck", "black", (0.05, 0.02, 0.16), (0.1, y, z)),
        block("bezel", "black", (width, 0.03, width * 0.6), (0.1, y, z + 0.12)),
        block(
            "screen", screen, (width - 0.02, 0.004, width * 0.6 - 0.02), (0.1, y + 0.017, z + 0.13)
        ),
        block("keyboard", "white_metal", (0.42, 0.13, 0.018), (0.1, y + 0.28, z)),
    ]


def nightstand(rng: Rng, palette: Palette) -> Piece:
    """A bedside box with drawers."""
    width, depth, high = between(rng, 0.38, 0.5), between(rng, 0.34, 0.42), between(rng, 0.42, 0.58)
    wood = palette.wood()
    parts = [block("box", wood, (width, depth, high - 0.1), (0, 0, 0.1), 0.006)]
    for a in (-1, 1):
        for b in (-1, 1):
            parts.append(
                block(
                    "leg",
                    wood,
                    (0.03, 0.03, 0.1),
                    (a * (width / 2 - 0.03), b * (depth / 2 - 0.03), 0),
                )
            )
    drawers = int(pick(rng, (1, 2)))
    tall = (high - 0.14) / drawers
    for k in range(drawers):
        z = 0.12 + k * tall
        parts.append(
            block("front", wood, (width - 0.05, 0.02, tall - 0.02), (0, depth / 2, z), 0.006)
        )
        parts.append(
            part(
                "knob",
                cylinder(0.014, 0.03),
                palette.metal(),
                (0, depth / 2 + 0.01, z + tall / 2),
                (-90.0, 0, 0),
                True,
            )
        )
    return Piece(
        "nightstand",
        tuple(parts),
        width,
        depth,
        high,
        (Top((0, 0), width - 0.08, depth - 0.08, high),),
    )
