"""`lux evaluate`: the tables of scores on a dataset."""

from __future__ import annotations

from pathlib import Path

import click
from click.core import ParameterSource

from luxcore.errors import InputError
from luxcore.files.input import check_input_file


@click.command("evaluate")
@click.option(
    "--dataset",
    required=True,
    type=click.Path(path_type=Path),
    help="Rendered rooms with known light, in the compact form or the public layout.",
)
@click.option(
    "--out",
    default=Path("evaluation"),
    show_default=True,
    type=click.Path(path_type=Path),
    help="Folder to write.",
)
@click.option(
    "--cases",
    default=112,
    show_default=True,
    type=click.IntRange(1),
    help="(panorama, lamp) cases with the lamp on, and again off.",
)
@click.option(
    "--groups",
    default=30,
    show_default=True,
    type=click.IntRange(0),
    help="Groups of views for the multi-view table.",
)
@click.option(
    "--size",
    default=128,
    show_default=True,
    type=click.IntRange(32, 1024),
    help="Side of a photo in pixels.",
)
@click.option(
    "--public-cases",
    default=None,
    type=click.Path(path_type=Path),
    help="paper_eval_cases.json of the public dataset: score the paper's own cases, all of them.",
)
@click.option(
    "--public-cameras",
    default=None,
    type=click.Path(path_type=Path),
    help="camera_params_48.json of the public dataset, with --public-cases.",
)
@click.option("--backend", default="small", show_default=True, help="Single-view model.")
@click.option("--mv-backend", default="small", show_default=True, help="Multi-view model.")
@click.option(
    "--sv-weights",
    default=None,
    type=click.Path(path_type=Path),
    help="Of the single-view model: a file, or for the paper's a folder or a hub id.",
)
@click.option(
    "--mv-weights",
    default=None,
    type=click.Path(path_type=Path),
    help="Of the multi-view model, likewise.",
)
@click.option(
    "--seed",
    default=0,
    show_default=True,
    type=click.IntRange(0),
    help="Of the photos that are cut from DATASET, and of models that sample.",
)
@click.option("--json", "as_json", is_flag=True, help="Print all numbers as JSON.")
def command(
    dataset: Path,
    out: Path,
    cases: int,
    groups: int,
    size: int,
    public_cases: Path | None,
    public_cameras: Path | None,
    backend: str,
    mv_backend: str,
    sv_weights: Path | None,
    mv_weights: Path | None,
    seed: int,
    as_json: bool,
) -> None:
    """Score the models on DATASET and print both tables, in the paper's form."""
    _check_given(dataset, public_cases, public_cameras)

    from luxcore.models.backends import check_weights

    check_weights(backend, sv_weights)
    check_weights(mv_backend, mv_weights)

    from luxcore.evaluate.dataset import evaluation_views
    from luxcore.evaluate.public_run import evaluate_public
    from luxcore.evaluate.run import evaluate_models
    from luxcore.files.atomic import write_json
    from luxcore.settings.evaluate import EvaluateSettings

    settings = EvaluateSettings(
        cases=cases, groups=groups, size_px=size, backend=backend, mv_backend=mv_backend
    )
    weights = {"sv_weights": sv_weights, "mv_weights": mv_weights}
    if public_cases is not None and public_cameras is not None:
        metrics = evaluate_public(
            dataset, public_cases, public_cameras, out, settings, seed=seed, **weights
        )
    else:
        views = evaluation_views(dataset)
        metrics = evaluate_models(views, [], out, settings, seed=seed, **weights)
    write_json(out / "metrics.json", metrics)
    if as_json:
        import json

        click.echo(json.dumps(metrics))
        return
    for table in sorted((out / "tables").glob("*.md")):
        click.echo(table.read_text(encoding="utf-8"))


def _check_given(dataset: Path, public_cases: Path | None, public_cameras: Path | None) -> None:
    """What can be said before the models' libraries are loaded, which takes seconds."""
    if (public_cases is None) != (public_cameras is None):
        raise InputError("--public-cases and --public-cameras go together.")
    source = click.get_current_context().get_parameter_source
    for name in ("cases", "groups"):
        if public_cases is not None and source(name) is not ParameterSource.DEFAULT:
            raise InputError(f"--{name} does not go with --public-cases, a list of its own.")
    if not dataset.exists():
        raise InputError(f"{dataset} does not exist.")
    for path in (public_cases, public_cameras):
        if path is not None:
            check_input_file(path)
