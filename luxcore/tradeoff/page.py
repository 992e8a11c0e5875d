"""The page of trade-offs: one curve per knob on logarithmic axes, the default marked."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from luxcore.files.atomic import atomic_file
from luxcore.files.pages import write_page_from
from luxcore.tradeoff.store import Measured, save_measured
from luxcore.tradeoff.sweep import Point, Sweep, dominating, front

LABEL_LETTERS = 40
"""Of a line beside the axis; longer names of errors are broken."""
ZERO_SHOWN = 1e-6
"""Where an error of zero is drawn: a logarithmic axis has no zero."""


@dataclass(frozen=True)
class Shown:
    """A sweep and what the page says of it."""

    sweep: Sweep
    picture: str
    best: frozenset[str]
    beaten_by: tuple[str, ...]

    @staticmethod
    def of(sweep: Sweep, picture: str) -> Shown:
        best = frozenset(point.label for point in front(sweep.points))
        return Shown(sweep, picture, best, tuple(point.label for point in dominating(sweep)))


def write_tradeoffs(out: Path, measured: Measured) -> Path:
    """Write `out`/tradeoff.html, tradeoff.json and one SVG per knob and capture; the page."""
    save_measured(out / "tradeoff.json", measured)
    knobs: dict[str, list[Shown]] = {}
    for sweep in measured.sweeps:
        shown = Shown.of(sweep, f"{_slug(sweep.knob)}-{_slug(sweep.scene)}.svg")
        with atomic_file(out / shown.picture) as temporary:
            draw(temporary, sweep)
        knobs.setdefault(sweep.knob, []).append(shown)
    _remove_stale(out, {shown.picture for group in knobs.values() for shown in group})
    template = Path(__file__).parent / "templates" / "tradeoff.html"
    return write_page_from(
        template,
        out / "tradeoff.html",
        knobs=knobs,
        about=measured.about,
        trials=measured.trials,
        scenes=sorted({sweep.scene for sweep in measured.sweeps}),
    )


def draw(path: Path, sweep: Sweep) -> None:
    """Error against processor seconds: medians, the range of repeats, the front, the default."""
    import matplotlib

    # Letters as text: their outlines would be most of the file.
    with matplotlib.rc_context(
        {"svg.hashsalt": "luxremix", "svg.fonttype": "none", "font.size": 9}
    ):
        from matplotlib.figure import Figure

        figure = Figure(figsize=(6.0, 3.6), layout="constrained")
        plot = figure.subplots()
        best = front(sweep.points)
        plot.plot(
            [p.seconds for p in best], [_shown(p.error) for p in best], color="#c9b08a", zorder=1
        )
        for place, point in enumerate(sorted(sweep.points, key=lambda p: p.seconds)):
            # Neighbours in time have their names above and below in turn.
            _draw_point(plot, point, place % 2 == 1, is_default=point.label == sweep.default)
        error = textwrap.fill(sweep.error_name, LABEL_LETTERS)
        plot.set(xscale="log", yscale="log", xlabel="processor time, s", ylabel=error)
        _spread_ticks(plot)
        plot.margins(0.2)
        plot.grid(alpha=0.2, which="both")
        plot.spines[["top", "right"]].set_visible(False)
        figure.savefig(path, format="svg", metadata={"Date": None})


def _spread_ticks(plot: Any) -> None:
    """A few plain numbers on each axis, also where the data spans less than a decade."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for axis in (plot.xaxis, plot.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=9))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())


def _draw_point(plot: Any, point: Point, below: bool, *, is_default: bool) -> None:
    x, y = point.seconds, _shown(point.error)
    colour = "#9a5b00" if is_default else "#555"
    bars = (
        [[x - point.seconds_range[0]], [point.seconds_range[1] - x]],
        [[y - min(y, _shown(point.error_range[0]))], [_shown(point.error_range[1]) - y]],
    )
    marker = {"marker": "*", "markersize": 12} if is_default else {"marker": "o", "markersize": 4}
    plot.errorbar(x, y, xerr=bars[0], yerr=bars[1], color=colour, elinewidth=0.8, **marker)
    label = f"{point.label} (default)" if is_default else point.label
    offset = (5, -11) if below else (5, 5)
    plot.annotate(label, (x, y), offset, textcoords="offset points", color=colour, fontsize=8)


def _shown(error: float) -> float:
    return max(error, ZERO_SHOWN)


def _slug(name: str) -> str:
    kept = "".join(letter if letter.isascii() and letter.isalnum() else " " for letter in name)
    return "-".join(kept.lower().split())


def _remove_stale(out: Path, pictures: set[str]) -> None:
    """Curves of knobs that are no more."""
    for path in out.glob("*.svg"):
        if path.name not in pictures:
            path.unlink()
