"""Sofas, armchairs, chairs, stools, beds."""

from __future__ import annotations

from luxcore.rooms.dice import Rng, between, chance, pick
from luxcore.rooms.model import Part
from luxcore.rooms.palette import Palette
from luxcore.rooms.piece import Piece, Top, block, part
from luxcore.rooms.shapes import Box, Ellipsoid, Lathe, cylinder


def _legs(
    material: str,
    width: float,
    depth: float,
    height: float,
    inset: float = 0.06,
    round_leg: bool = True,
) -> list[Part]:
    x, y = width / 2 - inset, depth / 2 - inset
    if round_leg:
        leg = Lathe(((0.0, 0.0), (0.016, 0.0), (0.024, height), (0.0, height)), 10)
        return [
            part("leg", leg, material, (a, b, 0.0), smooth=True) for a in (-x, x) for b in (-y, y)
        ]
    return [
        block("leg", material, (0.045, 0.045, height), (a, b, 0.0))
        for a in (-x, x)
        for b in (-y, y)
    ]


def sofa(rng: Rng, palette: Palette, seats: int | None = None) -> Piece:
    """One to three seats: base, back, arms, seat and scatter cushions, feet."""
    count = seats or int(pick(rng, (2, 3), (0.4, 0.6)))
    seat, arm = between(rng, 0.56, 0.68), between(rng, 0.12, 0.24)
    width, depth = round(count * seat + 2 * arm, 3), between(rng, 0.82, 0.98)
    foot, high, back = between(rng, 0.08, 0.16), between(rng, 0.4, 0.46), between(rng, 0.74, 0.9)
    fabric, soft = palette.fabric(), between(rng, 0.03, 0.06)
    parts = _legs(palette.wood(), width, depth, foot)
    parts += [
        block("base", fabric, (width - 0.02, depth, 0.22), (0, 0, foot), 0.03),
        block("back", fabric, (width - 0.04, 0.2, back - foot), (0, -depth / 2 + 0.1, foot), soft),
    ]
    arm_height = high + between(rng, 0.12, 0.22) - foot
    arm_x = (width - arm) / 2
    parts += [
        block("arm", fabric, (arm, depth, arm_height), (side * arm_x, 0, foot), soft)
        for side in (-1, 1)
    ]
    for k in range(count):
        parts += _seat(fabric, (k - (count - 1) / 2) * seat, (seat, depth), foot, high)
    parts += [
        _scatter_cushion(rng, palette, width, depth, high) for _ in range(int(rng.integers(0, 4)))
    ]
    return Piece("sofa", tuple(parts), width, depth, back)


def _seat(fabric: str, x: float, size: tuple[float, float], foot: float, high: float) -> list[Part]:
    """A seat cushion at `x` and the one behind its sitter's back; `size` is (seat, depth)."""
    seat, depth = size
    block_size = (seat - 0.01, depth - 0.24, high - foot - 0.2)
    cushion = Ellipsoid((seat / 2 - 0.01, 0.1, 0.23), 20, 0.45)
    behind = (x, -depth / 2 + 0.28, high + 0.2)
    return [
        block("seat", fabric, block_size, (x, 0.1, foot + 0.2), 0.05),
        part("cushion", cushion, fabric, behind, (-12.0, 0.0, 0.0), True),
    ]


def _scatter_cushion(rng: Rng, palette: Palette, width: float, depth: float, high: float) -> Part:
    size = between(rng, 0.17, 0.22)
    accent = palette.new("fabric", palette.accent(), scale=between(rng, 0.02, 0.12))
    x = between(rng, -width / 2 + 0.35, width / 2 - 0.35)
    place = (x, -depth / 2 + 0.43, high + size - 0.02)
    turned = (-20.0, between(rng, -15, 15), 0.0)
    return part("scatter", Ellipsoid((size, 0.07, size), 16, 0.5), accent, place, turned, True)


def armchair(rng: Rng, palette: Palette) -> Piece:
    """A sofa of one seat."""
    piece = sofa(rng, palette, 1)
    return Piece("armchair", piece.parts, piece.width, piece.depth, piece.height)


def chair(rng: Rng, palette: Palette) -> Piece:
    """A dining or desk chair: four legs or a swivel base, a seat, a back of slats or a panel."""
    width, depth, high = between(rng, 0.42, 0.5), between(rng, 0.42, 0.5), between(rng, 0.43, 0.47)
    frame, back = palette.wood(), between(rng, 0.82, 0.98)
    seat = pick(rng, (frame, palette.fabric()))
    parts: list[Part] = []
    if chance(rng, 0.25):
        parts.append(part("column", cylinder(0.025, high), palette.metal(), smooth=True))
        parts.append(
            part(
                "foot",
                Lathe(((0.0, 0.0), (0.26, 0.0), (0.25, 0.02), (0.03, 0.05), (0.0, 0.05)), 20),
                palette.metal(),
                smooth=True,
            )
        )
    else:
        parts += _legs(frame, width, depth, high, 0.03, chance(rng, 0.6))
    parts.append(block("seat", seat, (width, depth, 0.05), (0, 0, high - 0.02), 0.015))
    for side in (-1, 1):
        parts.append(
            block(
                "post",
                frame,
                (0.03, 0.03, back - high),
                (side * (width / 2 - 0.03), -depth / 2 + 0.02, high),
            )
        )
    if chance(rng, 0.5):
        for k in range(3):
            parts.append(
                block(
                    "slat",
                    frame,
                    (width - 0.06, 0.018, 0.06),
                    (0, -depth / 2 + 0.02, high + 0.12 + k * (back - high - 0.2) / 2),
                )
            )
    else:
        parts.append(
            block(
                "panel",
                seat,
                (width - 0.03, 0.04, back - high - 0.1),
                (0, -depth / 2 + 0.03, high + 0.1),
                0.015,
            )
        )
    return Piece("chair", tuple(parts), width, depth, back)


def stool(rng: Rng, palette: Palette) -> Piece:
    """A pouf or a round stool."""
    radius, high = between(rng, 0.18, 0.28), between(rng, 0.38, 0.48)
    shape = Ellipsoid((radius, radius, high / 2), 24, 0.5)
    return Piece(
        "stool",
        (part("pouf", shape, palette.fabric(), (0, 0, high / 2), smooth=True),),
        2 * radius,
        2 * radius,
        high,
        (Top((0, 0), radius, radius, high),),
    )


def bed(rng: Rng, palette: Palette) -> Piece:
    """Single or double: frame, mattress, quilt that hangs over, pillows, headboard, throw."""
    width, depth = pick(rng, (0.95, 1.45, 1.65, 1.8)), 2.05
    frame, quilt = palette.wood(), palette.fabric()
    sheet = palette.new("fabric", (0.7, 0.69, 0.67), (0.78, 0.77, 0.75), scale=0.3)
    base, high, head = between(rng, 0.2, 0.3), between(rng, 0.48, 0.58), between(rng, 0.85, 1.2)
    headboard = pick(rng, (frame, palette.fabric()))
    parts = [
        *_legs(frame, width, depth, base, 0.08, False),
        block("frame", frame, (width + 0.06, depth, 0.12), (0, 0, base - 0.1)),
        block("mattress", sheet, (width, depth - 0.06, high - base), (0, 0.01, base), 0.05),
        block(
            "quilt",
            quilt,
            (width + 0.08, depth * 0.68, high - base - 0.05),
            (0, depth * 0.15, base + 0.08),
            0.05,
        ),
        block("headboard", headboard, (width + 0.08, 0.07, head), (0, -depth / 2 + 0.02, 0), 0.02),
    ]
    pillows = 1 if width < 1.2 else 2
    for k in range(pillows):
        x = (k - (pillows - 1) / 2) * width / 2
        parts.append(
            part(
                "pillow",
                Ellipsoid((0.33, 0.22, 0.09), 20, 0.5),
                sheet,
                (x, -depth / 2 + 0.36, high + 0.08),
                (14.0, 0.0, 0.0),
                True,
            )
        )
    if chance(rng, 0.6):
        throw = palette.new("fabric", palette.accent(), scale=0.05)
        parts.append(
            block("throw", throw, (width + 0.1, 0.45, 0.03), (0, depth * 0.34, high + 0.01), 0.012)
        )
    return Piece("bed", tuple(parts), width + 0.1, depth, head)


def bench(rng: Rng, palette: Palette) -> Piece:
    """A long low seat."""
    width = between(rng, 0.9, 1.4)
    wood = palette.wood()
    parts = [
        *_legs(wood, width, 0.36, 0.42, 0.05, False),
        part("seat", Box((width, 0.36, 0.04), (0, 0, 0.44)), wood),
    ]
    return Piece("bench", tuple(parts), width, 0.36, 0.46, (Top((0, 0), width, 0.36, 0.46),))
