"""`lux convert FROM --out DIR`: between the compact form and the public dataset layout."""

from __future__ import annotations

from pathlib import Path

import click


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
    panoramas, with depth, transforms.json and COLMAP's sparse/0.
    """
    import shutil

    from luxcore.data.compact import holds_compact, list_rendered
    from luxcore.data.convert import compact_to_public, cut_photos, public_to_compact
    from luxcore.data.public_writer import write_shards
    from luxcore.files.output import check_out_folder

    # Scenes and rooms are written whole: one of the same name would be replaced.
    check_out_folder(out)
    if photos is not None:
        size = (photo_size, photo_size)
        folders = cut_photos(source, out, photos=photos, size=size, seed=seed)
        click.echo(f"{len(folders)} rooms in {out}")
        return
    if not holds_compact(source):
        stems = public_to_compact(source, out)
        click.echo(f"{len(stems)} views in {out}")
        return
    scenes = compact_to_public(list_rendered(source), out, first_scene=first_scene, seed=seed)
    if shards is not None:
        for shard in write_shards(scenes, out, shards):
            click.echo(f"{shard}")
        for scene in scenes:
            shutil.rmtree(scene)
    click.echo(f"{len(scenes)} scenes in {out}")
