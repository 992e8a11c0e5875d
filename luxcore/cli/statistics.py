"""`lux statistics FOLDER`: a page about a rendered dataset or a public shard."""

from __future__ import annotations

from pathlib import Path

import click

from luxcore.errors import InputError


@click.command(name="statistics")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--units", type=click.Path(path_type=Path), default=None, metavar="STORE",
              help="Unit store of the render: adds the CPU seconds that it kept.")  # fmt: skip
@click.option("--title", default="", help="Of the page; else the folder's name.")
@click.option("--out", type=click.Path(path_type=Path), default=None,
              help="Folder to write; else FOLDER itself.")  # fmt: skip
def command(folder: Path, units: Path | None, title: str, out: Path | None) -> None:
    """Write statistics.html and contact_sheet.png about the views in FOLDER.

    FOLDER holds rendered views in the compact form, or scenes or tar shards of the public layout;
    it may also be one shard.
    """
    from luxcore.statistics.dataset import PAGE, write_statistics
    from luxcore.units import UnitStore, read_seconds

    seconds = read_seconds(UnitStore(units)) if units else None
    if units and not seconds:
        raise InputError(f"{units} keeps no seconds of a render.")
    target = out or (folder if folder.is_dir() else folder.parent)
    facts = write_statistics(folder, target, title=title, seconds=seconds)
    click.echo(f"{len(facts)} views of {len({f.room for f in facts})} rooms: {target / PAGE}")
