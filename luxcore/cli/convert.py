"""`lux convert FROM --out DIR`: between the compact form and the public dataset layout."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from luxcore.errors import LuxError

if TYPE_CHECKING:
    from luxcore.data.convert import Converted


@click.command(name="convert")
@click.argument("source", metavar="FROM", type=click.Path(path_type=Path))
@click.option("--first-scene", default=0, show_default=True, type=click.IntRange(0, 999_999),
              help="To public: id of the first scene.")  # fmt: skip
@click.option("--seed", default=0, show_default=True, type=click.IntRange(0),
              help="Draws the lights of mixes 2 and 3, or where photos look.")  # fmt: skip
@click.option("--shards", type=click.Choice(["training", "test"]), default=None,
              help="To public: pack the scenes into tars of ten.")  # fmt: skip
@click.option("--photos", type=click.IntRange(1, 1000), default=None, metavar="N",
              help="Instead: N overlapping photos a room.")  # fmt: skip
@click.option("--photo-size", type=click.IntRange(16, 4096), default=512, show_default=True,
              help="Side of these photos in pixels.")  # fmt: skip
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Folder to write.")
def command(
    source: Path,
    first_scene: int,
    seed: int,
    shards: str | None,
    photos: int | None,
    photo_size: int,
    out: Path,
) -> None:
    """Convert rendered views, whichever way FROM asks for.

    A folder of views in the compact form becomes scenes of the public layout, one a room. Scenes
    of the public layout (a folder, a shard, a folder of shards) become views in the compact form;
    shards are not unpacked. With --photos, each room becomes a folder of photos cut out of its
    panoramas, with depth, transforms.json and COLMAP's sparse/0. A room that cannot be read is
    named and left out whole; the others go on, and the exit code is 1.
    """
    from luxcore.data.compact import holds_compact, list_rendered
    from luxcore.data.convert import compact_to_public, cut_photos, public_to_compact
    from luxcore.files.output import check_out_folder

    # Scenes and rooms are written whole: one of the same name would be replaced.
    check_out_folder(out)
    if photos is not None:
        size = (photo_size, photo_size)
        done = cut_photos(source, out, photos=photos, size=size, seed=seed)
        _tell(done, "rooms", out)
    elif holds_compact(source):
        stems = list_rendered(source)
        done = compact_to_public(stems, out, first_scene=first_scene, seed=seed)
        if shards is not None:
            _pack(done.written, out, shards)
        _tell(done, "scenes", out)
    else:
        _tell(public_to_compact(source, out), "views", out)


def _pack(scenes: list[Path], out: Path, split: str) -> None:
    import shutil

    from luxcore.data.public_writer import write_shards

    for shard in write_shards(scenes, out, split):
        click.echo(f"{shard}")
    for scene in scenes:
        shutil.rmtree(scene)


def _tell(done: Converted, what: str, out: Path) -> None:
    """Raises LuxError when a room was left out."""
    for room, cause in done.failed.items():
        click.echo(f"left out {room}: {cause}", err=True)
    click.echo(f"{len(done.written)} {what} in {out}")
    if done.failed:
        first, *others = done.failed
        rooms = f"{first} and {len(others)} more" if others else first
        raise LuxError(f"{out} lacks {rooms}, which could not be converted.")
