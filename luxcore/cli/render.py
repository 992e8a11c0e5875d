"""`lux render --rooms N --out DIR`: rooms, procedural or imported, in the public dataset layout."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from luxcore.cli.float_range import FiniteRange

if TYPE_CHECKING:
    from luxcore.rooms.model import Room


@click.command(name="render")
@click.option("--rooms", default=None, type=click.IntRange(1, 1_000_000),
              help="How many procedural rooms.")  # fmt: skip
@click.option("--import", "files", multiple=True, metavar="FILE",
              type=click.Path(path_type=Path),
              help="A room from elsewhere: .blend, .gltf, .glb, .usd, .usda, .usdc, .usdz, .obj, "
              "a folder of .obj, or Aria's scene language (.txt). May be repeated.")  # fmt: skip
@click.option("--unit-m", default=None, type=FiniteRange(min=0, min_open=True),
              help="Metres in one unit of an imported file; else what the file says.")  # fmt: skip
@click.option("--seed", default=0, show_default=True, type=click.IntRange(0, 999_999),
              help="Seed and id of the first room; room k has S + k.")  # fmt: skip
@click.option("--size", default="512x256", show_default=True, help="Panorama, width twice height.")
@click.option("--spp", default=16, show_default=True, type=click.IntRange(1, 4096),
              help="Samples per pixel.")  # fmt: skip
@click.option("--views", default=4, show_default=True, type=click.IntRange(1, 4),
              help="Panoramas a room; fewer where fewer fit.")  # fmt: skip
@click.option("--hdris", default="", metavar="FOLDER",
              help="Environments (.exr, .hdr); else Blender's own.")  # fmt: skip
@click.option("--shards", type=click.Choice(["training", "test"]), default=None,
              help="Pack the scenes into tars of ten.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Folder to write.")
def command(
    rooms: int | None,
    files: tuple[Path, ...],
    unit_m: float | None,
    seed: int,
    size: str,
    spp: int,
    views: int,
    hdris: str,
    shards: str | None,
    as_json: bool,
    out: Path,
) -> None:
    """Render furnished rooms, every lamp by itself, in the public LuxRemix layout.

    Rooms are drawn from seeds (--rooms N), or imported with their own lamps (--import FILE).
    Writes one folder a room, statistics.html, contact_sheet.png and statistics/. A call that was
    killed goes on where it stopped. LUX_EXECUTOR and LUX_WORKERS choose where the work runs.
    """
    import json

    from luxcore.render.public import render_public
    from luxcore.settings.render import RenderSettings
    from luxcore.units import executor_from_environment

    if (rooms is None) == (not files):
        raise click.UsageError("say either --rooms N or --import FILE.")
    # A room that fails is named and left out; the others are worth keeping.
    settings = RenderSettings(
        height=_height(size), spp=spp, views_per_room=views, max_failed_ratio=1.0
    )
    wanted = _imported(files, seed, unit_m) if files else _drawn(rooms or 0, seed, hdris)
    done = render_public(wanted, out, settings, executor_from_environment(), shard_split=shards)
    if as_json:
        scenes = [scene.name for scene in done.scenes]
        click.echo(json.dumps({"scenes": scenes, "views": done.views, "failed": done.failed}))
        return
    for name, cause in sorted(done.failed.items()):
        click.echo(f"left out {name}: {cause}", err=True)
    click.echo(f"{len(done.scenes)} of {len(wanted)} rooms, {done.views} panoramas in {out}")


def _drawn(count: int, seed: int, hdris: str) -> list[Room]:
    from luxcore.rooms.generate import generate_room
    from luxcore.settings.rooms import RoomsSettings

    return [generate_room(seed + k, RoomsSettings(hdri_folder=hdris)) for k in range(count)]


def _imported(files: tuple[Path, ...], seed: int, unit_m: float | None) -> list[Room]:
    """The rooms of files, with ids from `seed` on; says what could not be kept."""
    from dataclasses import replace

    from luxcore.imports import import_room

    rooms = []
    for number, file in enumerate(files, start=seed):
        imported = import_room(file, seed=number, unit_m=unit_m)
        rooms.append(replace(imported.room, seed=number))
        lamps = ", ".join(lamp.name for lamp in imported.room.lamps)
        click.echo(f"{rooms[-1].id}: {file}, lamps {lamps}", err=True)
        for note in imported.notes:
            click.echo(f"{rooms[-1].id}: {note}", err=True)
    return rooms


def _height(size: str) -> int:
    """Rows of "512x256". Raises InputError unless the width is twice the height."""
    from luxcore.errors import InputError

    width, _, height = size.partition("x")
    if not (width.isdecimal() and height.isdecimal()) or int(width) != 2 * int(height):
        raise InputError(f"--size {size} must be WxH with a width of twice the height.")
    if not 16 <= int(height) <= 4096:
        raise InputError(f"--size {size} must have 16 to 4096 rows.")
    return int(height)
