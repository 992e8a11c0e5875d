"""A scene-language file as a Room: walls with holes, doors, boxes for objects, lamps added.

The language has no materials and mostly no lamps: materials are drawn from the seed as for any
room, objects that are called lamps become lamps, and a room without any gets ceiling lamps.
"""

from __future__ import annotations

import math
import re

from luxcore.imports.outline import floor_outline, is_inside, signed_area, spread_points
from luxcore.imports.scene_language import BoxLine, LanguageScene, OpeningLine, WallLine
from luxcore.rooms.dice import between, stream
from luxcore.rooms.lamps import ceiling, standing
from luxcore.rooms.lighting import Fittings
from luxcore.rooms.model import Environment, Opening, Part, Room
from luxcore.rooms.palette import Palette, draw_palette
from luxcore.rooms.piece import placed
from luxcore.rooms.plan import Wall
from luxcore.rooms.shapes import Box, Prism, Vec2

DEFAULT_THICKNESS_M = 0.12
"""Walls of the public scenes have thickness 0: light would leak through an infinitely thin one."""

AREA_PER_LAMP_M2 = 14.0
MAX_LAMPS, MAX_VIEWPOINTS = 6, 4
EYE_HEIGHT_M = 1.5
_LAMP = re.compile(r"lamp|chandelier|(?<![a-z])light(?![a-z])", re.IGNORECASE)


def language_to_room(scene: LanguageScene, seed: int) -> Room:
    """The room of a scene, its floor at z = 0; materials and added lamps follow from the seed."""
    floor_z = min(wall.foot_z for wall in scene.walls.values())
    outline = floor_outline(list(scene.walls.values()))
    height = max(wall.height for wall in scene.walls.values())
    palette = draw_palette(stream(seed, "palette"), "imported")
    fittings = _lamps(scene, outline, height, floor_z, palette, seed)
    parts = [Part("floor", Prism(outline, 0.0), "floor"), _ceiling(outline, height)]
    openings = []
    for number, wall in scene.walls.items():
        side = _side(wall, outline)
        mine = [o for o in scene.openings if o.wall == number]
        parts += _wall(wall, side, mine, floor_z, palette)
        openings += [_opening(side, wall, o, floor_z) for o in mine if o.kind == "window"]
    parts += [_box(b, floor_z, palette) for b in scene.boxes if not _LAMP.search(b.label)]
    lamp_places = [(lamp.position[0], lamp.position[1]) for lamp in fittings.lamps]
    viewpoints = spread_points(outline, MAX_VIEWPOINTS, lamp_places)
    return Room(
        seed=seed,
        use="imported",
        outline=outline,
        height=height,
        materials=dict(palette.materials),
        parts=(*parts, *fittings.parts),
        lamps=tuple(fittings.lamps),
        spots=tuple(fittings.spots),
        openings=tuple(openings),
        environment=_environment(seed) if openings else None,
        viewpoints=tuple((x, y, min(EYE_HEIGHT_M, 0.6 * height)) for x, y in viewpoints),
    )


def _environment(seed: int) -> Environment:
    rng = stream(seed, "environment")
    return Environment("courtyard", between(rng, 0.0, 360.0), between(rng, 0.5, 3.0))


def _ceiling(outline: tuple[Vec2, ...], height: float) -> Part:
    xs, ys = zip(*outline, strict=True)
    size = (max(xs) - min(xs) + 1, max(ys) - min(ys) + 1, 0.1)
    middle = ((min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2, height)
    return Part("ceiling", Box(size, (0.0, 0.0, 0.05)), "ceiling", middle)


def _side(wall: WallLine, outline: tuple[Vec2, ...]) -> Wall:
    """The wall with the room to its left, so that its y axis points inside."""
    side = Wall(wall.a, wall.b)
    x, y = side.point(wall.length / 2, 0.1)
    return side if is_inside(outline, x, y) else Wall(wall.b, wall.a)


def _along(side: Wall, opening: OpeningLine) -> float:
    """How far along the wall the centre of an opening is."""
    dx, dy = side.end[0] - side.start[0], side.end[1] - side.start[1]
    x, y, _ = opening.centre
    return ((x - side.start[0]) * dx + (y - side.start[1]) * dy) / side.length


def _wall(
    wall: WallLine, side: Wall, openings: list[OpeningLine], floor_z: float, palette: Palette
) -> list[Part]:
    """Boxes around the windows; doors are closed leaves on both faces."""
    t = wall.thickness or DEFAULT_THICKNESS_M
    top = wall.height + 0.1
    spans, x = [], -t / 2
    for window in sorted(
        (o for o in openings if o.kind == "window"), key=lambda o: _along(side, o)
    ):
        left = max(x, _along(side, window) - window.width / 2)
        right = max(left, min(left + window.width, side.length))
        sill = max(0.0, window.centre[2] - floor_z - window.height / 2)
        lintel = min(wall.height, sill + window.height)
        spans += [(x, left, 0.0, top), (left, right, 0.0, sill), (left, right, lintel, top)]
        x = right
    spans.append((x, side.length + t / 2, 0.0, top))
    parts = [
        Part("wall", Box((b - a, t, d - c), ((a + b) / 2, -t / 2, (c + d) / 2)), "wall")
        for a, b, c, d in spans
        if b - a > 1e-6 and d - c > 1e-6
    ]
    for door in (o for o in openings if o.kind == "door"):
        size = (door.width, t + 0.05, door.height)
        leaf = Box(size, (_along(side, door), -t / 2, door.height / 2))
        parts.append(Part("door", leaf, palette.wood()))
    return list(placed(tuple(parts), (*side.start, wall.foot_z - floor_z), side.yaw_deg))


def _opening(side: Wall, wall: WallLine, window: OpeningLine, floor_z: float) -> Opening:
    depth = (wall.thickness or DEFAULT_THICKNESS_M) / 2
    x, y = side.point(_along(side, window), -depth)
    centre = (x, y, round(window.centre[2] - floor_z, 4))
    return Opening("window", centre, window.width, window.height, side.inward)


def _box(box: BoxLine, floor_z: float, palette: Palette) -> Part:
    soft = re.search(r"sofa|chair|bed|rug|cushion|curtain|couch", box.label, re.IGNORECASE)
    material = palette.fabric() if soft else palette.wood()
    place = (box.centre[0], box.centre[1], box.centre[2] - floor_z)
    turn = (0.0, 0.0, round(math.degrees(box.yaw_rad), 4))
    return Part(box.label, Box(box.size, bevel=0.01), material, place, turn)


def _lamps(
    scene: LanguageScene,
    outline: tuple[Vec2, ...],
    height: float,
    floor_z: float,
    palette: Palette,
    seed: int,
) -> Fittings:
    rng, fittings = stream(seed, "lamps"), Fittings()
    for box in [b for b in scene.boxes if _LAMP.search(b.label)][:MAX_LAMPS]:
        x, y, z = box.centre[0], box.centre[1], box.centre[2] - floor_z
        if z + box.size[2] / 2 > 0.8 * height:
            fittings.add(rng, "ceiling", ceiling.draw(rng, palette), (x, y, height), 0.0, 0.0)
        elif z - box.size[2] / 2 < 0.3:
            fittings.add(rng, "floor", standing.draw_floor(rng, palette), (x, y, 0.0), 0.0, 0.0)
        else:
            foot = (x, y, round(z - box.size[2] / 2, 4))
            fittings.add(rng, "table", standing.draw_table(rng, palette), foot, 0.0, 0.0)
    if not fittings.lamps:
        count = round(abs(signed_area(outline)) / AREA_PER_LAMP_M2)
        for x, y in spread_points(outline, max(1, min(MAX_LAMPS, count))):
            fittings.add(rng, "ceiling", ceiling.draw(rng, palette), (x, y, height), 0.0, 0.0)
    return fittings
