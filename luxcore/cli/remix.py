"""`lux remix CAPTURE --out DIR`."""

from __future__ import annotations

from pathlib import Path

import click


@click.command(name="remix")
@click.argument("capture", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path), help="The scene's folder.")
@click.option("--params", type=click.Path(path_type=Path), help="A params.yaml; else defaults.")
def command(capture: Path, out: Path, params: Path | None) -> None:
    """Photos (with poses and masks or without) to a relightable splat scene.

    CAPTURE is a folder of photos, a nerfstudio folder, a COLMAP project or a capture.
    """
    from luxcore.errors import InputError
    from luxcore.settings.load import load_settings
    from luxcore.settings.project import ProjectSettings

    if not capture.is_dir():
        raise InputError(f"{capture} is not a folder.")
    settings = load_settings(params) if params else ProjectSettings()

    from luxcore.remix import remix

    remix(capture, out, settings, click.echo)
