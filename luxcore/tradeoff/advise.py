"""Settings for a budget of time or a wish for quality, with what to expect of them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from luxcore.errors import InputError
from luxcore.tradeoff.sweep import Point, Sweep, front

Quality = Literal["low", "default", "high"]
_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0}


@dataclass(frozen=True)
class Advice:
    """One choice per knob."""

    chosen: dict[str, Point]

    @property
    def seconds(self) -> float:
        """Processor seconds of all knobs' work together, on the scene of the sweep."""
        return sum(point.seconds for point in self.chosen.values())

    @property
    def settings(self) -> dict[str, Any]:
        """Dotted paths into params.yaml. Where two knobs set one path, the later wins."""
        return {k: v for point in self.chosen.values() for k, v in point.settings.items()}


def within_budget(sweeps: Sequence[Sweep], budget_s: float) -> Advice:
    """The choices on the fronts that fit `budget_s`, taking first what helps most per second.

    Starts from the fastest of every knob; each step goes one place along one front, where the
    error falls by the largest factor per second. Raises InputError when the fastest do not fit.
    """
    fronts = {sweep.knob: front(sweep.points) for sweep in sweeps}
    place = dict.fromkeys(fronts, 0)
    spent = sum(points[0].seconds for points in fronts.values())
    if spent > budget_s:
        raise InputError(f"a budget of {budget_s:.0f} s is too small: the least is {spent:.1f} s.")
    while steps := _steps(fronts, place, budget_s - spent):
        knob = max(steps, key=lambda name: steps[name])
        spent += fronts[knob][place[knob] + 1].seconds - fronts[knob][place[knob]].seconds
        place[knob] += 1
    return Advice({knob: fronts[knob][index] for knob, index in place.items()})


def with_quality(sweeps: Sequence[Sweep], quality: Quality) -> Advice:
    """The fastest, the default or the most accurate choice of every knob."""
    chosen = {}
    for sweep in sweeps:
        points = front(sweep.points)
        end = points[0] if quality == "low" else points[-1]
        keeps = quality == "default" and sweep.default
        chosen[sweep.knob] = sweep.point(sweep.default) if keeps else end
    return Advice(chosen)


def parse_budget(text: str) -> float:
    """Seconds of "90s", "2min", "1.5 h" or a plain number of seconds."""
    match = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(s|min|h)?\s*", text)
    if not match:
        raise InputError(f"budget {text!r} is not a time such as 90s, 2min or 1h.")
    return float(match[1]) * _UNITS[match[2] or "s"]


def _steps(
    fronts: dict[str, list[Point]], place: dict[str, int], left_s: float
) -> dict[str, float]:
    """Gain per second of the next place along each front that still fits."""
    gains = {}
    for knob, points in fronts.items():
        if place[knob] + 1 < len(points):
            now, then = points[place[knob]], points[place[knob] + 1]
            cost = then.seconds - now.seconds
            if cost <= left_s:
                factor = math.log(max(now.error, 1e-12) / max(then.error, 1e-12))
                gains[knob] = factor / max(cost, 1e-6)
    return gains
