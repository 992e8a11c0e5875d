"""What predicting light instead of pixels is worth: `python -m luxcore.models.small.ablation`."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from luxcore.errors import LuxError
from luxcore.files.atomic import write_json
from luxcore.settings.train_sv import TrainSvSettings


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--data", required=True, type=click.Path(path_type=Path), help="Rendered rooms.")
@click.option("--out", required=True, type=click.Path(path_type=Path), help="JSON file to write.")
@click.option("--steps", default=600, show_default=True, help="Optimizer steps of each network.")
@click.option("--groups", default=200, show_default=True, help="Groups cut from the renders.")
@click.option("--size", default=64, show_default=True, help="Side of a photo in pixels.")
@click.option("--photos", default=6, show_default=True, help="Photos a step.")
@click.option("--rate", default=2e-3, show_default=True, help="Peak learning rate.")
@click.option("--seed", default=0, show_default=True)
def main(
    data: Path, out: Path, steps: int, groups: int, size: int, photos: int, rate: float, seed: int
) -> None:
    """Train the variants on equal terms and score them on photos of rooms kept aside."""
    from luxcore.models.small.alternatives import compare
    from luxcore.models.small.training import SHAPES, pools, single_cases
    from luxcore.models.small.weights import shipped_network

    settings = TrainSvSettings(groups=groups, size_px=size, validation_groups=16)
    try:
        pool, aside = pools(data, settings, seed)
        cases = single_cases(aside, seed, shipped_network("geometry"))
        scores = compare(pool, cases, steps, photos, rate, seed)
    except LuxError as error:
        click.echo(f"lux: {error}", err=True)
        sys.exit(error.exit_code)
    write_json(out, {"steps": steps, "parameters": SHAPES["sv"].as_metadata(), "psnr": scores})
    for name, values in scores.items():
        click.echo(f"{name:14s} " + "  ".join(f"{k} {v:.2f} dB" for k, v in values.items()))


if __name__ == "__main__":
    main()
