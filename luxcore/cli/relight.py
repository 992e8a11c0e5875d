"""`lux relight SCENE --set "desk=0.5,#ffd0a0" --camera CAMERA.json --out x.png`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from luxcore.cli.camera_file import read_camera
from luxcore.cli.float_range import FiniteRange
from luxcore.cli.image_out import check_out, write_image
from luxcore.cli.lamp_options import parse_lamp_settings
from luxcore.errors import InputError

if TYPE_CHECKING:
    from luxcore.cameras import Camera


@click.command(name="relight")
@click.argument("scene", type=click.Path(path_type=Path))
@click.option(
    "--set", "options", multiple=True, metavar="NAME=INTENSITY[,#rrggbb]",
    help="A lamp (or ambient): 0 is off, 1 is as in the photos. May be given many times.",
)  # fmt: skip
@click.option("--camera", type=click.Path(path_type=Path), help="One nerfstudio frame as JSON.")
@click.option("--view", type=int, help="Instead of --camera: that of this photo, from 0.")
@click.option("--ev", default=0.0, show_default=True, type=FiniteRange(-32, 32),
              help="Stops brighter, for PNG.")  # fmt: skip
@click.option("--out", required=True, type=click.Path(path_type=Path), help=".png or .exr (linear)")
def command(
    scene: Path,
    options: tuple[str, ...],
    camera: Path | None,
    view: int | None,
    ev: float,
    out: Path,
) -> None:
    """One image of a relightable SCENE under any mix of its lamps.

    PNG is AgX at the scene's exposure; EXR holds linear radiance.
    """
    check_out(out)
    from luxcore.splats.scene_files import check_scene

    # Before the imports that take seconds.
    check_scene(scene)
    settings = parse_lamp_settings(options)

    from luxcore.light.agx import agx
    from luxcore.splats.relighting import mixing_weights, render_scene
    from luxcore.splats.scene import load_scene

    loaded = load_scene(scene)
    mixing_weights(loaded, settings)
    where = _camera(scene, camera, view)
    linear = render_scene(loaded, where, settings)
    write_image(out, linear, agx(loaded.tone.exposure * 2.0**ev * linear))
    click.echo(f"{out}: {where.width}x{where.height}, {len(loaded.lamps)} lamps")


def _camera(scene: Path, file: Path | None, view: int | None) -> Camera:
    if file is not None and view is not None:
        raise InputError("give --camera or --view, not both.")
    if file is not None:
        return read_camera(file)
    return read_camera(scene / "transforms.json", view or 0)
