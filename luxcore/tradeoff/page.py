"""The page of trade-offs: one curve per knob on logarithmic axes, the default marked."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jinja2

from luxcore.files.atomic import atomic_file
from luxcore.tradeoff.sweep import Sweep, dominating, front, save_sweeps

ZERO_SHOWN = 1e-6
"""Where an error of zero is drawn: a logarithmic axis has no zero."""


def write_tradeoffs(out: Path, sweeps: Sequence[Sweep], about: dict[str, Any]) -> Path:
    """Write `out`/tradeoff.html, tradeoff.json and one SVG per knob; returns the page."""
    save_sweeps(out / "tradeoff.json", sweeps, about)
    for index, sweep in enumerate(sweeps):
        with atomic_file(out / f"tradeoff-{index:02d}.svg") as temporary:
            draw(temporary, sweep)
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
        undefined=jinja2.StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    text = environment.get_template("tradeoff.html").render(
        sweeps=sweeps,
        about=about,
        best=[{p.label for p in front(s.points)} for s in sweeps],
        beaten=[[p.label for p in dominating(s)] for s in sweeps],
    )
    with atomic_file(out / "tradeoff.html") as temporary:
        temporary.write_text(text, encoding="utf-8")
    return out / "tradeoff.html"


def draw(path: Path, sweep: Sweep) -> None:
    """Error against processor seconds: medians, the range of repeats, the front, the default."""
    import matplotlib

    with matplotlib.rc_context({"svg.hashsalt": "luxremix", "font.size": 9}):
        from matplotlib.figure import Figure

        figure = Figure(figsize=(6.0, 3.6), layout="constrained")
        plot = figure.subplots()
        best = front(sweep.points)
        plot.plot(
            [p.seconds for p in best], [_shown(p.error) for p in best], color="#c9b08a", zorder=1
        )
        for point in sweep.points:
            _draw_point(plot, point, is_default=point.label == sweep.default)
        plot.set(xscale="log", yscale="log", xlabel="processor time, s", ylabel=sweep.error_name)
        plot.margins(0.15)
        plot.grid(alpha=0.2, which="both")
        plot.spines[["top", "right"]].set_visible(False)
        figure.savefig(path, format="svg", metadata={"Date": None})


def _draw_point(plot: Any, point: Any, *, is_default: bool) -> None:
    x, y = point.seconds, _shown(point.error)
    colour = "#9a5b00" if is_default else "#555"
    bars = (
        [[x - point.seconds_range[0]], [point.seconds_range[1] - x]],
        [[y - min(y, _shown(point.error_range[0]))], [_shown(point.error_range[1]) - y]],
    )
    marker = {"marker": "*", "markersize": 12} if is_default else {"marker": "o", "markersize": 4}
    plot.errorbar(x, y, xerr=bars[0], yerr=bars[1], color=colour, elinewidth=0.8, **marker)
    label = f"{point.label} (default)" if is_default else point.label
    plot.annotate(label, (x, y), (5, 5), textcoords="offset points", color=colour, fontsize=8)


def _shown(error: float) -> float:
    return max(error, ZERO_SHOWN)
