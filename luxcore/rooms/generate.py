"""A furnished and lit room from a seed alone."""

from __future__ import annotations

from pathlib import Path

from luxcore.errors import InputError
from luxcore.rooms.decor import clutter, mirror, picture, rug
from luxcore.rooms.dice import Rng, between, chance, pick, stream
from luxcore.rooms.furnish import furnish
from luxcore.rooms.layout import Layout
from luxcore.rooms.lighting import Fittings, light_room
from luxcore.rooms.model import Environment, Part, Room
from luxcore.rooms.palette import Palette, draw_palette
from luxcore.rooms.piece import placed
from luxcore.rooms.plan import draw_plan
from luxcore.rooms.shell import build_shell
from luxcore.rooms.viewpoints import draw_viewpoints
from luxcore.settings.rooms import RoomsSettings

OUTDOOR_HDRIS = ("city", "courtyard", "forest", "sunrise", "sunset", "night")
"""The environments in Blender's own package that look like what is outside a window."""


def generate_room(seed: int, settings: RoomsSettings) -> Room:
    """The room of this seed: the same alone, in a batch, and on any machine.

    Raises InputError when `settings.hdri_folder` holds no environment.
    """
    plan = draw_plan(stream(seed, "plan"))
    palette = draw_palette(stream(seed, "palette"), plan.use)
    shell = build_shell(stream(seed, "shell"), plan, palette)
    layout = Layout(plan, shell.holes)
    furnish(stream(seed, "furniture"), layout, palette)
    fittings = light_room(
        stream(seed, "lamps"), layout, palette, settings.max_lamps, settings.off_probability
    )
    decor = _decorate(stream(seed, "decor"), layout, palette, fittings)
    furniture = [p for found in layout.placed for p in found.parts]
    environment = _draw_environment(stream(seed, "environment"), settings)
    return Room(
        seed=seed,
        use=plan.use,
        outline=plan.outline,
        height=plan.height,
        materials=dict(palette.materials),
        parts=(*shell.parts, *furniture, *decor, *fittings.parts),
        lamps=tuple(fittings.lamps),
        spots=tuple(fittings.spots),
        openings=shell.openings,
        environment=environment if shell.openings else None,
        viewpoints=draw_viewpoints(stream(seed, "viewpoints"), layout, fittings.lamps),
    )


def _decorate(rng: Rng, layout: Layout, palette: Palette, fittings: Fittings) -> list[Part]:
    parts: list[Part] = []
    parts += _rugs(rng, layout, palette)
    for _ in range(int(rng.integers(3, 9))):
        width, height = between(rng, 0.3, 1.1), between(rng, 0.35, 0.9)
        z = between(rng, 1.4, 1.65)
        found = layout.on_wall(rng, width, z - height / 2, z + height / 2)
        if found is None:
            continue
        side = layout.plan.walls[found[0]]
        hang = mirror if chance(rng, 0.14) else picture
        at = (*side.point(found[1]), z)
        parts += placed(hang(rng, palette, width, height), at, side.yaw_deg)
    for found_piece in layout.placed:
        for top, at in found_piece.tops():
            taken = 0.22 if at in fittings.on_tops else 0.0
            things = clutter(rng, palette, top, taken)
            local = placed(things, (-top.center[0], -top.center[1], -top.z))
            parts += placed(local, at, found_piece.yaw_deg)
    return parts


def _rugs(rng: Rng, layout: Layout, palette: Palette) -> tuple[Part, ...]:
    """Under the table, before the sofa or bed, else in the middle."""
    if not chance(rng, 0.75):
        return ()
    main = max(layout.plan.rects, key=lambda r: r.area)
    anchors = [p for p in layout.placed if p.piece.name in ("coffee_table", "dining_table", "bed")]
    at = anchors[0].at if anchors else ((main.x0 + main.x1) / 2, (main.y0 + main.y1) / 2)
    wide = min(between(rng, 1.6, 2.8), main.x1 - main.x0 - 0.5)
    deep = min(between(rng, 1.2, 2.0), main.y1 - main.y0 - 0.5)
    box = layout.plan.bounds
    x = min(max(at[0], box.x0 + wide / 2 + 0.1), box.x1 - wide / 2 - 0.1)
    y = min(max(at[1], box.y0 + deep / 2 + 0.1), box.y1 - deep / 2 - 0.1)
    return placed(rug(rng, palette, round(wide, 4), round(deep, 4)), (x, y, 0.001))


def _draw_environment(rng: Rng, settings: RoomsSettings) -> Environment:
    """Any hour: from moonlight to a sunny noon, log-uniform in radiance."""
    names = environment_names(settings)
    name = pick(rng, names)
    low, high = (0.02, 0.4) if name == "night" else (0.2, 9.0)
    mean = round(low * (high / low) ** float(rng.random()), 4)
    return Environment(name, between(rng, 0.0, 360.0), mean)


def environment_names(settings: RoomsSettings) -> tuple[str, ...]:
    """Blender's outdoor HDRIs, or the files of the user's folder, sorted."""
    if not settings.hdri_folder:
        return OUTDOOR_HDRIS
    folder = Path(settings.hdri_folder)
    files = sorted(str(p) for p in folder.glob("*") if p.suffix.lower() in (".exr", ".hdr"))
    if not files:
        raise InputError(f"{folder} holds no .exr or .hdr environment.")
    return tuple(files)
