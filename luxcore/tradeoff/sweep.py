"""Measurements of one knob, what is best for its time, and whether the default is."""

from __future__ import annotations

import json
import statistics
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from luxcore.errors import FormatError, InputError
from luxcore.files.atomic import write_json
from luxcore.progress import progress
from luxcore.tradeoff.knob import Bench, Knob, Work

VERSION = 1


@dataclass(frozen=True)
class Point:
    """All repeats of one choice."""

    label: str
    settings: dict[str, Any]
    works: tuple[Work, ...]

    @property
    def seconds(self) -> float:
        """Median processor seconds: a busy machine does not change them."""
        return statistics.median(work.cpu_s for work in self.works)

    @property
    def error(self) -> float:
        return statistics.median(work.error for work in self.works)

    @property
    def seconds_range(self) -> tuple[float, float]:
        return _range([work.cpu_s for work in self.works])

    @property
    def error_range(self) -> tuple[float, float]:
        return _range([work.error for work in self.works])


@dataclass(frozen=True)
class Sweep:
    """One knob, measured."""

    knob: str
    error_name: str
    why: str
    default: str
    points: tuple[Point, ...]

    def point(self, label: str) -> Point:
        """The point of a choice."""
        return next(point for point in self.points if point.label == label)


def measure(knob: Knob, bench: Bench, repeats: int, *, quiet: bool = False) -> Sweep:
    """Run every choice `repeats` times, interleaved, so that a drift of the machine hits all."""
    prepared = knob.prepare(bench)
    # The first run of all pays for imports, kernels and caches: it is not counted.
    knob.run(prepared, knob.choices[0], 0)
    works: dict[str, list[Work]] = {choice.label: [] for choice in knob.choices}
    total = repeats * len(knob.choices)
    with progress(f"tradeoff {knob.name}", total, "runs", quiet=quiet) as bar:
        for repeat in range(repeats):
            for choice in knob.choices:
                works[choice.label].append(knob.run(prepared, choice, repeat))
                bar.advance(1, choice=choice.label)
    points = tuple(Point(c.label, c.settings, tuple(works[c.label])) for c in knob.choices)
    return Sweep(knob.name, knob.error, knob.why, knob.default(bench.params), points)


def front(points: Sequence[Point]) -> list[Point]:
    """The Pareto front by medians, fastest first: nothing is both faster and better."""
    kept: list[Point] = []
    for point in sorted(points, key=lambda p: (p.seconds, p.error)):
        if not kept or point.error < kept[-1].error:
            kept.append(point)
    return kept


def dominating(sweep: Sweep) -> list[Point]:
    """Choices that beat the default in time and in error by more than the spread of repeats."""
    if not sweep.default:
        return []
    default = sweep.point(sweep.default)
    return [
        point
        for point in sweep.points
        if point.seconds_range[1] < default.seconds_range[0]
        and point.error_range[1] < default.error_range[0]
    ]


def save_sweeps(path: Path, sweeps: Sequence[Sweep], about: dict[str, Any]) -> None:
    """Write all measurements; `about` says on what."""
    write_json(path, {"version": VERSION, "about": about, "sweeps": [asdict(s) for s in sweeps]})


def load_sweeps(path: Path) -> tuple[list[Sweep], dict[str, Any]]:
    """Sweeps and what they were measured on. Raises InputError or FormatError naming the file."""
    if not path.is_file():
        raise InputError(f"{path} does not exist: `lux tradeoff` measures it.")
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        if data["version"] != VERSION:
            raise FormatError(f"{path} is of version {data['version']}, not {VERSION}.")
        return [_sweep(record) for record in data["sweeps"]], data["about"]
    except (ValueError, KeyError, TypeError) as error:
        raise FormatError(f"{path} does not hold sweeps: {error!r}.") from error


def merged(
    path: Path, fresh: Sequence[Sweep], about: dict[str, Any], order: Sequence[str]
) -> list[Sweep]:
    """`fresh` and those sweeps of `path` that were measured on the same thing, in `order`."""
    kept: list[Sweep] = []
    if path.is_file():
        old, old_about = load_sweeps(path)
        kept = old if old_about == about else []
    latest = {sweep.knob: sweep for sweep in (*kept, *fresh)}
    return [latest[name] for name in order if name in latest]


def _sweep(record: dict[str, Any]) -> Sweep:
    points = tuple(
        Point(p["label"], p["settings"], tuple(Work(**work) for work in p["works"]))
        for p in record["points"]
    )
    knob, error_name, why, default = (
        str(record[name]) for name in ("knob", "error_name", "why", "default")
    )
    return Sweep(knob, error_name, why, default, points)


def _range(values: Sequence[float]) -> tuple[float, float]:
    return min(values), max(values)
