"""`lux export SCENE --format ply [--set …] [--lamps] --out FILE_OR_FOLDER`."""

from __future__ import annotations

import re
from pathlib import Path

import click

from luxcore.cli.lamp_options import parse_lamp_settings
from luxcore.errors import InputError


@click.command(name="export")
@click.argument("scene", type=click.Path(path_type=Path))
@click.option("--format", "form", type=click.Choice(["ply"]), default="ply", show_default=True)
@click.option(
    "--set", "options", multiple=True, metavar="NAME=INTENSITY[,#rrggbb]",
    help="The light to bake in; without it, that of the photos.",
)  # fmt: skip
@click.option("--lamps", is_flag=True, help="One PLY for ambient and for each lamp, into a folder.")
@click.option("--out", required=True, type=click.Path(path_type=Path))
def command(scene: Path, form: str, options: tuple[str, ...], lamps: bool, out: Path) -> None:
    """A relightable SCENE as plain 3DGS PLY, its light baked into display colours (AgX).

    Each Gaussian is tone-mapped by itself, so the picture differs a little from `lux relight`.
    """
    settings = parse_lamp_settings(options)
    if lamps and settings:
        raise InputError("--lamps shows each lamp alone and takes no --set.")

    from luxcore.files.atomic import atomic_folder
    from luxcore.splats.light_views import AMBIENT
    from luxcore.splats.ply import write_ply
    from luxcore.splats.relighting import baked_gaussians, solo
    from luxcore.splats.scene import load_scene

    loaded = load_scene(scene)
    if not lamps:
        if out.suffix.lower() != ".ply":
            raise InputError(f"{out} must end in .ply.")
        write_ply(out, baked_gaussians(loaded, settings))
        click.echo(f"{out}: {len(loaded.gaussians)} Gaussians")
        return
    names = [AMBIENT, *(lamp.name for lamp in loaded.lamps)]
    with atomic_folder(out) as folder:
        for index, name in enumerate(names):
            # A lamp's name is free text: the number keeps file names apart.
            safe = re.sub(r"[^A-Za-z0-9_-]+", "_", name)[:64]
            file = folder / f"{index:02d}_{safe}.ply"
            write_ply(file, baked_gaussians(loaded, solo(loaded, name)))
    click.echo(f"{out}: {len(names)} files of {len(loaded.gaussians)} Gaussians")
