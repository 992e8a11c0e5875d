"""`lux render --rooms N --out DIR`: procedural rooms in the public dataset layout."""

from __future__ import annotations

from pathlib import Path

import click


@click.command(name="render")
@click.option("--rooms", required=True, type=click.IntRange(1, 1_000_000), help="How many rooms.")
@click.option("--seed", default=0, show_default=True, type=click.IntRange(0, 999_999),
              help="Seed of the first room; room k has seed S + k.")  # fmt: skip
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
    rooms: int,
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

    Writes one folder a room, contact_sheet.png and statistics/. A call that was killed goes on
    where it stopped. LUX_EXECUTOR and LUX_WORKERS choose where the work runs.
    """
    import json

    from luxcore.render.public import render_public
    from luxcore.settings.render import RenderSettings
    from luxcore.settings.rooms import RoomsSettings
    from luxcore.units import executor_from_environment

    # A room that fails is named and left out; the others are worth keeping.
    settings = RenderSettings(
        height=_height(size), spp=spp, views_per_room=views, max_failed_ratio=1.0
    )
    done = render_public(
        range(seed, seed + rooms),
        out,
        settings,
        RoomsSettings(hdri_folder=hdris),
        executor_from_environment(),
        shard_split=shards,
    )
    if as_json:
        scenes = [scene.name for scene in done.scenes]
        click.echo(json.dumps({"scenes": scenes, "views": done.views, "failed": done.failed}))
        return
    for name, cause in sorted(done.failed.items()):
        click.echo(f"left out {name}: {cause}", err=True)
    click.echo(f"{len(done.scenes)} of {rooms} rooms, {done.views} panoramas in {out}")


def _height(size: str) -> int:
    """Rows of "512x256". Raises InputError unless the width is twice the height."""
    from luxcore.errors import InputError

    width, _, height = size.partition("x")
    if not (width.isdecimal() and height.isdecimal()) or int(width) != 2 * int(height):
        raise InputError(f"--size {size} must be WxH with a width of twice the height.")
    if not 16 <= int(height) <= 4096:
        raise InputError(f"--size {size} must have 16 to 4096 rows.")
    return int(height)
