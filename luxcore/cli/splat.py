"""`lux splat render FILE.ply --camera CAMERA.json --out x.exr`."""

from __future__ import annotations

from pathlib import Path

import click

from luxcore.cli.camera_file import read_camera
from luxcore.cli.image_out import check_out, write_image


@click.group(name="splat")
def command() -> None:
    """Rasterize any 3D Gaussian splatting PLY."""


@command.command(name="render")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--camera", required=True, type=click.Path(path_type=Path), help="nerfstudio frame")
@click.option("--out", required=True, type=click.Path(path_type=Path), help=".png or .exr")
def render(file: Path, camera: Path, out: Path) -> None:
    """One image of FILE on black, in the colours that the file stores (display-referred)."""
    check_out(out)

    from luxcore.splats.ply import read_ply

    where = read_camera(camera)
    gaussians = read_ply(file)
    # Only now, as loading it takes longer than finding out that a file cannot be used.
    from luxcore.splats.relighting import splat_image

    image = splat_image(gaussians, where)
    write_image(out, None, image)
    click.echo(
        f"{out}: {where.width}x{where.height}, {len(gaussians)} Gaussians, "
        f"harmonics of degree {gaussians.sh_degree}"
    )
