"""Bars and histograms as SVG: one colour, values written where they are, details on hover."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np

WIDTH, ROW, LABELS = 420, 22, 132
PLOT_HEIGHT, FOOT, TOP = 130, 34, 18
SIDE = 8


def bars(values: Mapping[str, float], unit: str = "") -> str:
    """A row for each name, in the mapping's order, with its value at the end."""
    most = max(values.values(), default=0.0) or 1.0
    room = WIDTH - LABELS - 64
    rows = []
    for number, (name, value) in enumerate(values.items()):
        top, length = number * ROW, room * value / most
        said = f"{short(value)}{unit}"
        rows.append(
            f"<g><title>{escape(name)}: {said}</title>"
            f'<text x="{LABELS - 8}" y="{top + 15}" text-anchor="end">{escape(name)}</text>'
            f'<rect x="{LABELS}" y="{top + 4}" width="{length:.1f}" height="{ROW - 8}" rx="2"/>'
            f'<text x="{LABELS + length + 6:.1f}" y="{top + 15}" class="value">{said}</text></g>'
        )
    return _svg(ROW * max(1, len(values)), rows)


def histogram(
    values: Sequence[float], edges: Sequence[float], unit: str = "", *, every: int = 4
) -> str:
    """Columns between `edges`; values beyond them count into the outer ones. The median is marked.

    `edges` must be evenly spaced, linearly or logarithmically: each column is equally wide.
    `every`: how many columns from one written edge to the next.
    """
    inside = np.clip(np.asarray(values, float), edges[0], edges[-1])
    counts, _ = np.histogram(inside, edges)
    wide = (WIDTH - 2 * SIDE) / len(counts)
    most = max(1, int(counts.max()))
    rows = []
    for number, count in enumerate(counts.tolist()):
        tall = (PLOT_HEIGHT - TOP) * count / most
        left, top = SIDE + number * wide, PLOT_HEIGHT - tall
        span = f"{short(edges[number])} to {short(edges[number + 1])}{unit}: {count}"
        rows.append(
            f'<g><title>{span}</title><rect class="catch" x="{left:.1f}" y="0" '
            f'width="{wide:.1f}" height="{PLOT_HEIGHT}"/><rect x="{left + 1:.1f}" y="{top:.1f}" '
            f'width="{max(wide - 2, 1):.1f}" height="{tall:.1f}" rx="1"/></g>'
        )
    rows.append(f'<path class="axis" d="M{SIDE} {PLOT_HEIGHT}H{WIDTH - SIDE}"/>')
    rows += _ticks(edges, wide, every)
    if len(inside):
        rows.append(_median(float(np.median(values)), edges, wide, unit))
    return _svg(PLOT_HEIGHT + FOOT, rows)


def short(value: float) -> str:
    """Three digits, without an exponent or trailing zeros: 0.0123, 4.5, 12,345."""
    if value == round(value) or abs(value) >= 1000:
        return f"{value:,.0f}"
    text = f"{value:.{max(0, 2 - int(np.floor(np.log10(abs(value)))))}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def _ticks(edges: Sequence[float], wide: float, every: int) -> list[str]:
    anchors = {0: "start", len(edges) - 1: "end"}
    return [
        f'<text x="{SIDE + i * wide:.1f}" y="{PLOT_HEIGHT + 16}" '
        f'text-anchor="{anchors.get(i, "middle")}">{short(edges[i])}</text>'
        for i in range(0, len(edges), every)
    ]


def _median(median: float, edges: Sequence[float], wide: float, unit: str) -> str:
    place = float(np.interp(median, edges, np.arange(len(edges))))
    x = SIDE + place * wide
    anchor, shift = ("end", -4) if x > WIDTH / 2 else ("start", 4)
    return (
        f'<path class="median" d="M{x:.1f} 2V{PLOT_HEIGHT}"/>'
        f'<text x="{x + shift:.1f}" y="12" text-anchor="{anchor}" class="value">'
        f"median {short(median)}{unit}</text>"
    )


def _svg(height: int, rows: Sequence[str]) -> str:
    return (
        f'<svg viewBox="0 0 {WIDTH} {height}" role="img" xmlns="http://www.w3.org/2000/svg">'
        f"{''.join(rows)}</svg>"
    )
