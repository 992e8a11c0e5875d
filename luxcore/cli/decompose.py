"""`lux decompose`: one photo and its lamps' masks to one linear image per lamp."""

from __future__ import annotations

from pathlib import Path

import click


@click.command("decompose")
@click.argument("photo", type=click.Path(path_type=Path))
@click.option(
    "--mask",
    "masks",
    multiple=True,
    type=click.Path(path_type=Path),
    metavar="M.png",
    help="A lamp: white on black or opaque on transparent, as large as the photo. Repeat for each "
    "lamp; without any, lamps are proposed.",
)
@click.option(
    "--off",
    "off",
    multiple=True,
    type=click.Path(path_type=Path),
    metavar="M.png",
    help="A lamp that is off in the photo and shall be lit. Repeatable.",
)
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Folder to write.")
@click.option(
    "--backend",
    default="small",
    show_default=True,
    help="small, or flux-kontext with weights of your own.",
)
@click.option("--weights", default=None, help="Weights: a file, a folder or a hub id.")
@click.option(
    "--option",
    "options",
    multiple=True,
    metavar="NAME=VALUE",
    help="An option of the backend (small: long_side_px). Repeatable.",
)
@click.option("--seed", default=0, show_default=True, type=click.IntRange(0))
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def command(
    photo: Path,
    masks: tuple[Path, ...],
    off: tuple[Path, ...],
    out: Path,
    backend: str,
    weights: str | None,
    options: tuple[str, ...],
    seed: int,
    as_json: bool,
) -> None:
    """Take the light of PHOTO apart.

    Writes ambient.exr and light_00.exr … in the order of the masks (--mask first, then --off),
    linear HDR and as large as the photo, lights.json with the scale factors, the photo with each
    lamp off and at three brightnesses, and blend.html, which mixes the lamps in a browser. A lamp
    given by --mask counts as off when its mask does not shine.
    """
    from luxcore.decompose.command import decompose_file, parse_options
    from luxcore.models.interface import BackendSettings

    settings = BackendSettings(sv_weights=weights, options=parse_options(options))
    result = decompose_file(photo, masks, off, out, backend, settings, seed)
    if as_json:
        import json

        click.echo(json.dumps(result))
        return
    lamps = ", ".join(f"{lamp['name']} {'on' if lamp['on'] else 'off'}" for lamp in result["lamps"])
    click.echo(f"{out}: {lamps or 'no lamps'}; recomposition {result['recomposition_db']:.1f} dB")
