"""The model's own linear light, or the three exposures of each light merged as in the paper."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from luxcore.files.exr import read_exr
from luxcore.light.fuse import bracket_paths, merge_files
from luxcore.tradeoff.knob import Bench, Choice, Knob, Work, stopwatch
from luxcore.tradeoff.knobs.models import ERROR, Truth

VIEWS = 4


@dataclass(frozen=True)
class _Prepared:
    folder: Path
    truth: Truth


def _prepare(bench: Bench) -> _Prepared:
    return _Prepared(bench.input("harmonize"), Truth.of(bench))


def _run(prepared: _Prepared, choice: Choice, repeat: int) -> Work:
    exposure, count = prepared.truth.capture.exposure or 1.0, len(prepared.truth.capture.frames)
    # Other views in every repeat: the same ones would give the same error to the bit.
    views = range(repeat % count, count, max(1, count // VIEWS))
    found = []
    with stopwatch() as watch:
        for view in views:
            direct = read_exr(prepared.folder / "direct" / f"{view:04d}.exr")
            lights = {}
            for name, linear in direct.items():
                if choice.settings["fuse.method"] == "debevec":
                    paths = bracket_paths(prepared.folder, view, name)
                    linear = merge_files(paths, exposure).radiance
                lights[name] = linear
            found.append((view, lights))
    return watch.work(prepared.truth.error(found))


METHOD = Knob(
    name="exposures or the model's own linear light",
    work="exposures merged",
    choices=tuple(
        Choice(label, {"fuse.method": method})
        for label, method in (("three exposures", "debevec"), ("direct", "direct"))
    ),
    error=ERROR,
    why="Equal errors at a small part of the time: merging is what the paper's display-referred "
    "models need, and a model that gives linear light does without.",
    prepare=_prepare,
    run=_run,
)
