"""Furniture by the use of a room."""

from __future__ import annotations

from collections.abc import Callable

from luxcore.rooms.dice import Rng, between, chance
from luxcore.rooms.furniture import seats, storage, tables
from luxcore.rooms.layout import Layout, Placed
from luxcore.rooms.palette import Palette
from luxcore.rooms.piece import Piece

Draw = Callable[[Rng, Palette], Piece]


def furnish(rng: Rng, layout: Layout, palette: Palette) -> None:
    """Place the pieces that the room's use asks for, as far as they fit."""
    _BY_USE[layout.plan.use](rng, layout, palette)
    if chance(rng, 0.7):
        layout.against_wall(rng, storage.plant(rng, palette), gap=0.05)


def _wall(rng: Rng, layout: Layout, palette: Palette, *draws: Draw) -> list[Placed]:
    found = [layout.against_wall(rng, draw(rng, palette)) for draw in draws]
    return [p for p in found if p is not None]


def _living(rng: Rng, layout: Layout, palette: Palette) -> None:
    seat = layout.against_wall(rng, seats.sofa(rng, palette))
    if seat is not None:
        low = tables.coffee_table(rng, palette)
        reach = seat.piece.depth / 2 + 0.4 + low.depth / 2
        layout.in_the_open(low, seat.beside(0.0, reach), seat.yaw_deg)
        side = tables.side_table(rng, palette)
        for sign in (1, -1):
            dx = sign * (seat.piece.width / 2 + side.width / 2 + 0.06)
            if layout.in_the_open(side, seat.beside(dx, -0.15), seat.yaw_deg):
                break
        chair = seats.armchair(rng, palette)
        turn = between(rng, 130.0, 215.0)
        at = seat.beside(between(rng, -0.9, 0.9), reach + low.depth / 2 + 0.45 + chair.depth / 2)
        layout.in_the_open(chair, at, seat.yaw_deg + turn)
    _wall(rng, layout, palette, storage.media_unit, storage.bookshelf)
    if chance(rng, 0.6):
        _wall(rng, layout, palette, storage.sideboard)
    if chance(rng, 0.4):
        _wall(rng, layout, palette, tables.side_table, seats.stool)


def _bedroom(rng: Rng, layout: Layout, palette: Palette) -> None:
    bed = layout.against_wall(rng, seats.bed(rng, palette), tries=60)
    if bed is not None:
        night = tables.nightstand(rng, palette)
        for sign in (-1, 1):
            dx = sign * (bed.piece.width / 2 + night.width / 2 + 0.05)
            dy = -bed.piece.depth / 2 + night.depth / 2
            layout.in_the_open(night, bed.beside(dx, dy), bed.yaw_deg)
    _wall(rng, layout, palette, storage.wardrobe, storage.dresser)
    if chance(rng, 0.5):
        _wall(rng, layout, palette, seats.armchair)
    if chance(rng, 0.3):
        _wall(rng, layout, palette, tables.desk)


def _kitchen(rng: Rng, layout: Layout, palette: Palette) -> None:
    for width in (3.0, 2.4, 1.8):
        if layout.against_wall(rng, storage.kitchen_run(rng, palette, width)):
            break
    _seated_table(rng, layout, palette)
    if chance(rng, 0.6):
        _wall(rng, layout, palette, storage.sideboard)
    if chance(rng, 0.3):
        _wall(rng, layout, palette, storage.bookshelf)


def _office(rng: Rng, layout: Layout, palette: Palette) -> None:
    desk = layout.against_wall(rng, tables.desk(rng, palette))
    if desk is not None:
        at = desk.beside(-0.1, desk.piece.depth / 2 + 0.2)
        chair = seats.chair(rng, palette)
        layout.in_the_open(chair, at, desk.yaw_deg + 180 + between(rng, -30, 30))
    _wall(rng, layout, palette, storage.bookshelf, storage.bookshelf, storage.sideboard)
    if chance(rng, 0.5):
        _wall(rng, layout, palette, seats.armchair, tables.side_table)


def _dining(rng: Rng, layout: Layout, palette: Palette) -> None:
    _seated_table(rng, layout, palette)
    _wall(rng, layout, palette, storage.sideboard, tables.console)
    if chance(rng, 0.5):
        _wall(rng, layout, palette, storage.bookshelf)


def _corridor(rng: Rng, layout: Layout, palette: Palette) -> None:
    _wall(rng, layout, palette, tables.console, seats.bench)
    if chance(rng, 0.4):
        _wall(rng, layout, palette, seats.stool, tables.console)


def _seated_table(rng: Rng, layout: Layout, palette: Palette) -> None:
    """A table as near to the middle as fits, and chairs drawn up to it."""
    piece = tables.dining_table(rng, palette)
    main = max(layout.plan.rects, key=lambda r: r.area)
    table = None
    for _ in range(30):
        at = (
            (main.x0 + main.x1) / 2 + between(rng, -0.6, 0.6),
            (main.y0 + main.y1) / 2 + between(rng, -0.6, 0.6),
        )
        yaw = 0.0 if main.x1 - main.x0 > main.y1 - main.y0 else 90.0
        table = layout.in_the_open(piece, at, yaw)
        if table is not None:
            break
    if table is None:
        return
    chair = seats.chair(rng, palette)
    out_y = piece.depth / 2 + chair.depth / 2 - 0.12
    out_x = piece.width / 2 + chair.depth / 2 - 0.12
    slots = [
        (dx, sign * out_y, 180.0 if sign > 0 else 0.0)
        for sign in (-1, 1)
        for dx in ((-0.3, 0.3) if piece.width < 1.6 else (-0.55, 0.0, 0.55))
    ]
    slots += [(out_x, 0.0, 90.0), (-out_x, 0.0, -90.0)]
    for dx, dy, turn in slots:
        if chance(rng, 0.85):
            _drawn_up(layout, table, chair, (dx, dy), turn + between(rng, -12, 12))


def _drawn_up(
    layout: Layout, table: Placed, chair: Piece, offset: tuple[float, float], turn: float
) -> None:
    """A chair may stand partly under its own table, not under other things."""
    layout.placed.remove(table)
    layout.in_the_open(chair, table.beside(*offset), table.yaw_deg + turn)
    layout.placed.append(table)


_BY_USE: dict[str, Callable[[Rng, Layout, Palette], None]] = {
    "living": _living,
    "bedroom": _bedroom,
    "kitchen": _kitchen,
    "office": _office,
    "dining": _dining,
    "corridor": _corridor,
}
