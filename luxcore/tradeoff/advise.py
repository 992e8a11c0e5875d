"""Settings for a budget of time or a wish for quality, with what to expect of them.

Several knobs turn the same work. What they do together is expected to be the product of what each
does alone, in time and in error; `lux tradeoff --try` does the work and says what came out.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

from luxcore.errors import InputError
from luxcore.tradeoff.knob import Bench, Choice, Knob, Work
from luxcore.tradeoff.sweep import Point, Sweep, front

Quality = Literal["low", "default", "high"]
_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0}
_TINY = 1e-12


@dataclass(frozen=True)
class Expected:
    """What one work is expected to take with the choices of all its knobs."""

    work: str
    labels: dict[str, str]
    """Knob → choice."""
    settings: dict[str, Any]
    """Dotted paths into params.yaml."""
    seconds: float
    """Processor seconds on the capture of the sweep, at the sweep's sizes."""
    error: float
    error_name: str


@dataclass(frozen=True)
class Tried:
    """A work that was done with the advised settings."""

    work: str
    settings: dict[str, Any]
    expected_s: float
    expected_error: float
    error_name: str
    obtained: Work


@dataclass(frozen=True)
class Trial:
    """What a piece of advice promised and gave."""

    asked: str
    scene: str
    works: tuple[Tried, ...]

    @property
    def expected_s(self) -> float:
        return sum(tried.expected_s for tried in self.works)

    @property
    def obtained_s(self) -> float:
        return sum(tried.obtained.cpu_s for tried in self.works)


@dataclass(frozen=True)
class Advice:
    """One choice per knob that params.yaml has."""

    sweeps: tuple[Sweep, ...]
    chosen: dict[str, Point]

    @cached_property
    def works(self) -> tuple[Expected, ...]:
        """Expectations in the order of the sweeps."""
        names = list(dict.fromkeys(sweep.work for sweep in self.sweeps))
        return tuple(self._expected([s for s in self.sweeps if s.work == name]) for name in names)

    @property
    def seconds(self) -> float:
        """Processor seconds of all works together."""
        return sum(expected.seconds for expected in self.works)

    @property
    def agrees(self) -> bool:
        """Whether no two choices want different values of one setting."""
        wanted: dict[str, Any] = {}
        for point in self.chosen.values():
            if any(wanted.get(path, value) != value for path, value in point.settings.items()):
                return False
            wanted |= point.settings
        return True

    @property
    def settings(self) -> dict[str, Any]:
        """Dotted paths into params.yaml."""
        return {k: v for expected in self.works for k, v in expected.settings.items()}

    def _expected(self, sweeps: list[Sweep]) -> Expected:
        first = sweeps[0]
        usual = first.point(first.default)
        seconds, error = usual.seconds, usual.error
        labels: dict[str, str] = {}
        settings: dict[str, Any] = {}
        for sweep in sweeps:
            point, default = self.chosen[sweep.knob], sweep.point(sweep.default)
            seconds *= point.seconds / max(default.seconds, _TINY)
            error *= point.error / max(default.error, _TINY)
            labels[sweep.knob] = point.label
            settings |= point.settings
        return Expected(first.work, labels, settings, seconds, error, first.error_name)


def within_budget(sweeps: Sequence[Sweep], budget_s: float) -> Advice:
    """The choices on the fronts that fit `budget_s`, taking first what helps most per second.

    Starts from the fastest of every knob; each step goes one place along one front, where the
    error falls by the largest factor per second. Raises InputError when the fastest do not fit.
    """
    advice = with_quality(sweeps, "low")
    fronts = {sweep.knob: front(sweep.points) for sweep in advice.sweeps}
    if advice.seconds > budget_s:
        raise InputError(
            f"a budget of {budget_s:.0f} s is too small: the least is {advice.seconds:.1f} s."
        )
    while steps := _steps(advice, fronts, budget_s):
        advice = max(steps, key=lambda step: step[0])[1]
    return advice


def with_quality(sweeps: Sequence[Sweep], quality: Quality) -> Advice:
    """The fastest, the default or the most accurate choice of every knob.

    Where two knobs want different values of one setting, the second takes its next best.
    """
    turned = _turned(sweeps)
    advice = Advice(turned, {sweep.knob: sweep.point(sweep.default) for sweep in turned})
    if quality == "default":
        return advice
    for sweep in turned:
        points = front(sweep.points)
        for point in points if quality == "low" else points[::-1]:
            step = Advice(turned, {**advice.chosen, sweep.knob: point})
            if step.agrees:
                advice = step
                break
    return advice


def try_out(advice: Advice, asked: str, knobs: Sequence[Knob], bench: Bench) -> Trial:
    """Do every work once with the advised settings."""
    tried = []
    for expected in advice.works:
        knob = next(knob for knob in knobs if knob.work == expected.work)
        prepared = knob.prepare(bench)
        # As in the sweep, imports and kernels are not counted.
        knob.run(prepared, knob.choices[0], 0)
        work = knob.run(prepared, Choice("as-advised", expected.settings), 0)
        tried.append(
            Tried(
                expected.work,
                expected.settings,
                expected.seconds,
                expected.error,
                expected.error_name,
                work,
            )
        )
    return Trial(asked, bench.capture, tuple(tried))


def parse_budget(text: str) -> float:
    """Seconds of "90s", "2min", "1.5 h" or a plain number of seconds."""
    match = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(s|min|h)?\s*", text)
    if not match:
        raise InputError(f"budget {text!r} is not a time such as 90s, 2min or 1h.")
    return float(match[1]) * _UNITS[match[2] or "s"]


def _turned(sweeps: Sequence[Sweep]) -> tuple[Sweep, ...]:
    kept = tuple(sweep for sweep in sweeps if sweep.can_be_set and sweep.default)
    if not kept:
        raise InputError("no knob that params.yaml has was measured yet: run `lux tradeoff`.")
    return kept


def _steps(
    advice: Advice, fronts: dict[str, list[Point]], budget_s: float
) -> list[tuple[float, Advice]]:
    """Gain per second of the next place along each front that still fits, and what it gives."""
    steps = []
    for knob, points in fronts.items():
        place = points.index(advice.chosen[knob])
        if place + 1 < len(points):
            now, then = points[place], points[place + 1]
            step = Advice(advice.sweeps, {**advice.chosen, knob: then})
            if step.agrees and step.seconds <= budget_s:
                factor = math.log(max(now.error, _TINY) / max(then.error, _TINY))
                steps.append((factor / max(step.seconds - advice.seconds, 1e-6), step))
    return steps
