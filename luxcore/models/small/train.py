"""The full recipe: `python -m luxcore.models.small.train sv --data DIR --out DIR`.

Starts from sketched rooms and rendered rooms together; `--base` goes on from given weights. Kill it
at any time: the same command goes on from `OUT/state.ckpt` and ends in the same bits.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from luxcore.errors import LuxError
from luxcore.settings.train_mv import TrainMvSettings
from luxcore.settings.train_sv import TrainingSettings, TrainSvSettings

STEPS = 20_000
"""About three hours on two quiet cores at 96 px."""


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("kind", type=click.Choice(["geometry", "sv", "mv"]))
@click.option("--data", required=True, type=click.Path(path_type=Path), help="Rendered rooms.")
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Folder to write.")
@click.option("--base", default=None, help='Weights to start from, or "shipped".')
@click.option("--steps", default=STEPS, show_default=True)
@click.option("--rooms", default=0, help="Only the first so many rooms; 0: all.")
@click.option("--photos", default=6, show_default=True, help="Photos a step, with all lamps.")
@click.option("--groups", default=600, show_default=True, help="Groups cut from the renders.")
@click.option("--sketches", default=300, show_default=True, help="Groups of sketched rooms.")
@click.option("--size", default=96, show_default=True, help="Side of a photo in pixels.")
@click.option("--rate", default=2e-3, show_default=True, help="Peak learning rate.")
@click.option(
    "--blend",
    default=TrainingSettings().blend,
    show_default=True,
    help="Share of the trained weights in what is written; the rest is the base's.",
)
@click.option(
    "--geometry-share",
    default=TrainSvSettings().geometry_share,
    show_default=True,
    help="Single-view photos that come with depth and normals; of the others both are guessed.",
)
@click.option(
    "--workers",
    default=0,
    show_default=True,
    type=click.IntRange(0, 64),
    help="Processes that make photos ahead of their use; any number gives the same weights.",
)
@click.option("--seed", default=0, show_default=True)
def main(
    kind: str,
    data: Path,
    out: Path,
    base: str | None,
    steps: int,
    rooms: int,
    photos: int,
    groups: int,
    sketches: int,
    size: int,
    rate: float,
    blend: float,
    geometry_share: float,
    workers: int,
    seed: int,
) -> None:
    """Train the geometry, the single-view (sv) or the multi-view (mv) model, in this order: each
    takes the shipped weights of those before it. Writes weights, card and curve."""
    import numpy as np

    from luxcore.files.photos import write_png
    from luxcore.models.small.geometry_training import train_geometry
    from luxcore.models.small.training import train_mv, train_sv

    shared = {
        "steps": steps,
        "groups": groups,
        "sketches": sketches,
        "size_px": size,
        "rate": rate,
        "base": base,
        "blend": blend,
        "photos_per_step": photos,
        "rooms": rooms,
        "check_every": 200,
        "validation_groups": 32,
        "cooldown": 0.4,
    }
    out.mkdir(parents=True, exist_ok=True)
    how: dict[str, Any] = {"checkpoint": out / "state.ckpt", "workers": workers}
    try:
        if kind == "geometry":
            scores = train_geometry(data, out, TrainingSettings(**shared), seed, **how)
            click.echo(f"{out}: {scores}")
            return
        if kind == "sv":
            settings = TrainSvSettings(**shared, geometry_share=geometry_share)
            result = train_sv(data, out, settings, seed, **how)
        else:
            result = train_mv(data, out, TrainMvSettings(**shared), seed, **how)
    except LuxError as error:
        click.echo(f"lux: {error}", err=True)
        sys.exit(error.exit_code)
    write_png(out / "validation.png", np.asarray(result.picture))
    click.echo(f"{out}: {result.metrics['psnr_validation']:.2f} dB on validation photos")


if __name__ == "__main__":
    main()
