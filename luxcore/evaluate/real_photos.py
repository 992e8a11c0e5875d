"""Real photos, beside the answers that others published: no truth, but a yardstick.

`python -m luxcore.evaluate.real_photos --olats DIR --grid DIR --out DIR`
- `--olats`: folders with `input.*`, `mask/`, and `ours/` holding the LuxRemix authors' OLATs.
- `--grid`: LightLab's photo of two lamps in 7 × 7 colours (`R_C.jpg`).
"""

from __future__ import annotations

import sys
from pathlib import Path

import click

from luxcore.errors import LuxError


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--olats", default=None, type=click.Path(path_type=Path), help="Authors' examples.")
@click.option("--grid", default=None, type=click.Path(path_type=Path), help="LightLab's 7 x 7.")
@click.option("--backend", default="small", show_default=True, help="Single-view model.")
@click.option("--sv-weights", default=None, help="Its weights; default: the shipped ones.")
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Folder to write.")
def main(
    olats: Path | None, grid: Path | None, backend: str, sv_weights: str | None, out: Path
) -> None:
    """Score a model on real photos against what others published for them."""
    from luxcore.evaluate.published import real_photo_rows
    from luxcore.models.backends import open_decomposer
    from luxcore.models.interface import BackendSettings

    out.mkdir(parents=True, exist_ok=True)
    try:
        folders = sorted(p for p in olats.iterdir() if p.is_dir()) if olats else []
        decomposer = open_decomposer(backend, BackendSettings(sv_weights=sv_weights))
        real_photo_rows(folders, grid, decomposer, out)
    except (LuxError, OSError) as error:
        click.echo(f"lux: {error}", err=True)
        sys.exit(1)
    click.echo((out / "real_photos.md").read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
