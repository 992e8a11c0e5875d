"""`lux view SCENE`."""

from __future__ import annotations

import threading
from pathlib import Path

import click

LOOPBACK = ("127.0.0.1", "localhost", "::1")


@click.command(name="view")
@click.argument("scene", type=click.Path(path_type=Path))
@click.option("--port", default=8080, show_default=True, type=click.IntRange(1, 65535))
@click.option(
    "--host", default="127.0.0.1", show_default=True, help="Where to listen. Default: this machine."
)
@click.option(
    "--out", default=Path("lux-view"), show_default=True, type=click.Path(path_type=Path),
    help="Folder for films and stills.",
)  # fmt: skip
def command(scene: Path, port: int, host: str, out: Path) -> None:
    """Interactive viewer of a relightable SCENE: a switch, dimmer and colour for every lamp."""
    from luxcore.ports import check_port
    from luxcore.splats.scene_files import check_scene

    # Before the imports that take seconds.
    check_scene(scene)
    check_port(host, port)
    from luxcore.viewer.app import Viewer
    from luxcore.viewer.open import open_scene

    viewed = open_scene(scene)
    if host not in LOOPBACK:
        click.echo(
            f"warning: anyone who can reach {host}:{port} can use this viewer, without a password.",
            err=True,
        )
    viewer = Viewer(viewed, host, port, out)
    click.echo(f"{len(viewed.scene.gaussians)} Gaussians, {len(viewed.scene.lamps)} lamps")
    click.echo(f"http://{host}:{port} (Ctrl-C ends it)")
    try:
        threading.Event().wait()
    finally:
        viewer.close()
