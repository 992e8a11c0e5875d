"""`lux convert FROM --out DIR`: between the compact form and the public dataset layout."""

from __future__ import annotations

from pathlib import Path

import click


@click.command(name="convert")
@click.argument("source", metavar="FROM", type=click.Path(path_type=Path))
@click.option("--first-scene", default=0, show_default=True, type=click.IntRange(0, 999_999),
              help="To public: id of the first scene.")  # fmt: skip
@click.option("--seed", default=0, show_default=True, type=click.IntRange(0),
              help="To public: draws the lights of mixes 2 and 3.")  # fmt: skip
@click.option("--shards", type=click.Choice(["training", "test"]), default=None,
              help="To public: pack the scenes into tars of ten.")  # fmt: skip
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Folder to write.")
def command(source: Path, first_scene: int, seed: int, shards: str | None, out: Path) -> None:
    """Convert rendered views, whichever way FROM asks for.

    A folder of views in the compact form becomes scenes of the public layout, one a room. Scenes
    of the public layout (a folder, a shard, a folder of shards) become views in the compact form;
    shards are not unpacked.
    """
    import shutil

    from luxcore.data.compact import holds_compact, list_rendered
    from luxcore.data.convert import compact_to_public, public_to_compact
    from luxcore.data.public_writer import write_shards

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
