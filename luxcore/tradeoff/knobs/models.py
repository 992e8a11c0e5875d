"""Photo resolution in the single-view model; views per pass and references in the multi-view."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from luxcore.capture import Capture, load_capture
from luxcore.decompose.stage import decompose_capture
from luxcore.errors import InputError
from luxcore.evaluate.captures import true_view
from luxcore.files.exr import read_exr
from luxcore.harmonize.stage import harmonize_capture
from luxcore.light.agx import agx
from luxcore.masks.store import LampMasks, load_masks
from luxcore.metrics.image import psnr
from luxcore.metrics.rescale import channel_scale
from luxcore.models.small.backend import LONG_SIDE_PX
from luxcore.tradeoff.knob import Bench, Choice, Knob, Work, stopwatch
from luxcore.units import UnitStore

ERROR = "RMS error of single lamps after rescale, display 0..1"


@dataclass(frozen=True)
class Truth:
    """The true light of the lamps, at the power of the photos, in the order of the masks."""

    capture: Capture
    masks: LampMasks

    @staticmethod
    def of(bench: Bench) -> Truth:
        """Raises InputError for a capture without known light."""
        capture = load_capture(bench.input("capture"))
        if capture.truth is None:
            raise InputError(f"{capture.root} has no known truth to compare models with.")
        return Truth(capture, load_masks(bench.input("masks")))

    def error(self, views: Iterable[tuple[int, dict[str, np.ndarray]]]) -> float:
        """Mean over views and lamps, after the rescale that the paper allows."""
        return float(np.mean([e for view, layers in views for e in self._errors(view, layers)]))

    def _errors(self, view: int, layers: dict[str, np.ndarray]) -> Iterator[float]:
        truth = true_view(self.capture, self.masks, view, max(layers["light_00"].shape))
        for index, light in enumerate(truth.lights):
            exact = np.asarray(light, np.float32)
            found = layers[f"light_{index:02d}"]
            scaled = found * channel_scale(found, exact).astype(np.float32)
            shown, target = (agx(np.float32(truth.exposure) * i) for i in (scaled, exact))
            yield 10.0 ** (-psnr(shown, target) / 20.0)


@dataclass(frozen=True)
class _Prepared:
    bench: Bench
    truth: Truth


def _prepare(bench: Bench) -> _Prepared:
    return _Prepared(bench, Truth.of(bench))


def _decompose(prepared: _Prepared, choice: Choice, repeat: int) -> Work:
    bench = prepared.bench
    out = bench.scratch / "decompose"
    with stopwatch() as watch:
        _take_apart(bench, choice, out)
    views = (
        (
            int(folder.name),
            {f.stem: next(iter(read_exr(f).values())) for f in folder.glob("light_*.exr")},
        )
        for folder in sorted(out.glob("[0-9][0-9][0-9][0-9]"))
    )
    return watch.work(prepared.truth.error(views))


def _take_apart(bench: Bench, choice: Choice, out: Path) -> None:
    settings = bench.params.decompose.model_copy(update=choice.section("decompose"))
    shutil.rmtree(out, ignore_errors=True)
    decompose_capture(
        bench.input("capture"), bench.input("masks"), bench.input("splat"), out, settings,
        weights=trained_weights(bench, "train_sv"),
    )  # fmt: skip


def _harmonize(prepared: _Prepared, choice: Choice, repeat: int) -> Work:
    """References taken apart and their light carried to all views."""
    bench = prepared.bench
    settings = bench.params.harmonize.model_copy(update=choice.section("harmonize"))
    out = bench.scratch / "harmonize"
    shutil.rmtree(out, ignore_errors=True)
    # An empty store each time: a finished pass would be taken from it.
    store = bench.scratch / "units"
    shutil.rmtree(store, ignore_errors=True)
    with stopwatch() as watch:
        _take_apart(bench, choice, bench.scratch / "references")
        harmonize_capture(
            bench.input("capture"), bench.input("masks"), bench.input("splat"),
            bench.scratch / "references", out, settings, UnitStore(store),
            weights=trained_weights(bench, "train_mv"),
        )  # fmt: skip
    files = sorted((out / "direct").glob("*.exr"))
    return watch.work(prepared.truth.error((int(f.stem), read_exr(f)) for f in files))


def trained_weights(bench: Bench, stage: str) -> Path | None:
    """The weights that the run trained, else those that are shipped."""
    path = bench.artifacts / stage / "model.safetensors"
    return path if path.is_file() else None


PHOTO_SIZE = Knob(
    name="photo resolution in decomposition",
    work="references taken apart",
    choices=tuple(
        Choice(f"{n} px", {"decompose.options": {"long_side_px": n}}) for n in (64, 96, 160, 256)
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
    work="light carried to all views",
    choices=tuple(Choice(str(n), {"harmonize.views_per_pass": n}) for n in (4, 8, 15)),
    error=ERROR,
    why="Every pass reads its references anew, so few large passes cost least; 15 is the most that "
    "the paper's memory holds. Smaller ones err one per cent less.",
    prepare=_prepare,
    run=_harmonize,
)

REFERENCES = Knob(
    name="reference views of a lamp",
    work="light carried to all views",
    # Several references of several lamps leave room for other views in a full pass only.
    choices=(
        Choice("1", {"decompose.references_per_lamp": 1}),
        *(
            Choice(str(n), {"decompose.references_per_lamp": n, "harmonize.views_per_pass": 15})
            for n in (2, 3)
        ),
    ),
    error=ERROR,
    why="One is the paper's choice and the cheapest: two more take a quarter more time and lower "
    "the error by one per cent.",
    prepare=_prepare,
    run=_harmonize,
)
