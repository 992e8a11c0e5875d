"""Measurements of one knob, what is best for its time, and whether the default is."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from luxcore.progress import progress
from luxcore.tradeoff.knob import Bench, Knob, Work


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
    """One knob, measured on one capture."""

    scene: str
    """Id of the capture."""
    knob: str
    work: str
    error_name: str
    why: str
    default: str
    points: tuple[Point, ...]

    def point(self, label: str) -> Point:
        """The point of a choice."""
        return next(point for point in self.points if point.label == label)

    @property
    def can_be_set(self) -> bool:
        """Whether params.yaml has this knob; others are built in."""
        return all(point.settings for point in self.points)


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
    default = knob.default(bench.params)
    return Sweep(bench.capture, knob.name, knob.work, knob.error, knob.why, default, points)


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


def _range(values: Sequence[float]) -> tuple[float, float]:
    return min(values), max(values)
