"""Photo resolution in the single-view model, views per pass in the multi-view model."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from luxcore.capture import load_capture
from luxcore.decompose.stage import decompose_capture
from luxcore.errors import InputError
from luxcore.files.exr import read_exr
from luxcore.harmonize.stage import harmonize_capture
from luxcore.light.agx import agx
from luxcore.metrics.image import psnr
from luxcore.metrics.rescale import channel_scale
from luxcore.models.small.backend import LONG_SIDE_PX
from luxcore.tradeoff.knob import Bench, Choice, Knob, Work, stopwatch
from luxcore.units import UnitStore

ERROR = "RMS error of single lamps after rescale, display 0..1"


def _error(views: Iterable[tuple[Path, dict[str, np.ndarray]]], exposure: float) -> float:
    """Mean over views and lamps, against the true light of each."""
    errors = []
    for truth_path, layers in views:
        truth = read_exr(truth_path)
        for name in sorted(set(layers) & set(truth) - {"ambient"}):
            scaled = layers[name] * channel_scale(layers[name], truth[name]).astype(np.float32)
            shown, exact = (agx(np.float32(exposure) * i) for i in (scaled, truth[name]))
            errors.append(10.0 ** (-psnr(shown, exact) / 20.0))
    return float(np.mean(errors))


def _truth(bench: Bench) -> Path:
    truth = load_capture(bench.input("capture")).truth
    if truth is None:
        raise InputError(f"{bench.input('capture')} has no known truth to compare models with.")
    return truth


def _decompose(bench: Bench, choice: Choice, repeat: int) -> Work:
    settings = bench.params.decompose.model_copy(
        update={"options": {"long_side_px": int(choice.label.split()[0])}}
    )
    out = bench.scratch / "decompose"
    shutil.rmtree(out, ignore_errors=True)
    with stopwatch() as watch:
        decompose_capture(
            bench.input("capture"), bench.input("masks"), bench.input("splat"), out, settings,
            weights=_weights(bench, "train_sv"),
        )  # fmt: skip
    truth = _truth(bench)
    exposure = load_capture(bench.input("capture")).exposure or 1.0
    views = (
        (
            truth / f"{folder.name}.exr",
            {f.stem: next(iter(read_exr(f).values())) for f in folder.glob("light_*.exr")},
        )
        for folder in sorted(out.glob("[0-9][0-9][0-9][0-9]"))
    )
    return watch.work(_error(views, exposure))


def _harmonize(bench: Bench, choice: Choice, repeat: int) -> Work:
    settings = bench.params.harmonize.model_copy(
        update={"views_per_pass": choice.settings["harmonize.views_per_pass"]}
    )
    out = bench.scratch / "harmonize"
    shutil.rmtree(out, ignore_errors=True)
    # An empty store each time: a finished pass would be taken from it.
    store = bench.scratch / "units"
    shutil.rmtree(store, ignore_errors=True)
    with stopwatch() as watch:
        harmonize_capture(
            bench.input("capture"), bench.input("masks"), bench.input("splat"),
            bench.input("decompose"), out, settings, UnitStore(store),
            weights=_weights(bench, "train_mv"),
        )  # fmt: skip
    truth = _truth(bench)
    exposure = load_capture(bench.input("capture")).exposure or 1.0
    files = sorted((out / "direct").glob("*.exr"))
    return watch.work(_error(((truth / f.name, read_exr(f)) for f in files), exposure))


def _weights(bench: Bench, stage: str) -> Path | None:
    """The weights that the run trained, else those that are shipped."""
    path = bench.artifacts / stage / "model.safetensors"
    return path if path.is_file() else None


def _prepare(bench: Bench) -> Bench:
    _truth(bench)
    return bench


PHOTO_SIZE = Knob(
    name="photo resolution in decomposition",
    choices=tuple(
        Choice(f"{n} px", {"decompose.options": {"long_side_px": n}}) for n in (96, 160, 256, 320)
    ),
    error=ERROR,
    why="The model's light is smooth and carried to the photo's own size, so a small side is "
    "enough.",
    prepare=_prepare,
    run=_decompose,
    fixed_default=f"{LONG_SIDE_PX} px",
)

VIEWS_PER_PASS = Knob(
    name="views per pass in harmonization",
    choices=tuple(Choice(str(n), {"harmonize.views_per_pass": n}) for n in (4, 8, 15)),
    error=ERROR,
    why="More views in one pass agree better and share the references' cost; 15 is the most that "
    "the paper's memory holds.",
    prepare=_prepare,
    run=_harmonize,
)
