"""The charts of a dataset's page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from luxcore.statistics.charts import bars, histogram
from luxcore.statistics.facts import LampFacts, ViewFacts

KELVIN_EDGES = tuple(np.linspace(2500, 6750, 18).tolist())
NOISE_EDGES = tuple(np.linspace(0, 4, 21).round(3).tolist())
ENERGY_EDGES = tuple(np.linspace(0.5, 1.5, 21).round(3).tolist())
SHARE_EDGES = tuple((10.0 ** (np.arange(-9, 4) / 3)).tolist())
"""Percent of a picture, logarithmic."""
STEPS = ("build", "render", "denoise", "top_up", "write")
MOST_BARS = 14


@dataclass(frozen=True)
class Chart:
    """A picture with its title and one line on how to read it."""

    title: str
    svg: str
    note: str = ""


def charts(views: Sequence[ViewFacts]) -> list[Chart]:
    """All charts that the facts allow, in the order of the page."""
    rooms = {view.room: view for view in views}
    lamps = [lamp for view in rooms.values() for lamp in view.lamps]
    counts = Counter(len(view.lamps) for view in rooms.values())
    found = [
        Chart(
            "Lamps a room",
            bars({str(n): float(counts[n]) for n in range(min(counts), max(counts) + 1)}),
            "rooms by their number of lamps",
        ),
        Chart("Kinds of lamps", bars(_ranked(m.kind for m in lamps)), "lamps, each room once"),
        Chart("Lamps that burn in the photo", bars(_lit(lamps), " %"), "share by kind"),
    ]
    uses = _ranked(view.use for view in rooms.values() if view.use)
    if uses:
        found.append(Chart("Use of the rooms", bars(uses), "rooms"))
    designs = _ranked(m.design for m in lamps if m.design)
    if designs:
        found.append(Chart("Designs", bars(designs), f"lamps; at most {MOST_BARS} designs"))
    kelvins = [m.temperature_k for m in lamps if m.temperature_k]
    if kelvins:
        found.append(Chart("Colour temperature", histogram(kelvins, KELVIN_EDGES, " K"), "lamps"))
    return found + _areas(views) + _quality(views) + _cost(views)


def _areas(views: Sequence[ViewFacts]) -> list[Chart]:
    found = []
    for title, field in (("Emitters", "emitter_px"), ("Fixtures", "fixture_px")):
        shares = [
            100 * getattr(lamp, field) / (view.size[0] * view.size[1])
            for view in views
            for lamp in view.lamps
            if getattr(lamp, field)
        ]
        if shares:
            svg = histogram(shares, SHARE_EDGES, " %", every=3)
            found.append(Chart(f"{title}: share of the picture", svg, "masks that are not empty"))
    return found


def _quality(views: Sequence[ViewFacts]) -> list[Chart]:
    lamps = [lamp for view in views for lamp in view.lamps]
    noise = [m.noise for m in lamps if m.noise is not None]
    energy = [m.energy_factor for m in lamps if m.energy_factor is not None]
    found = []
    if noise:
        note = "before the denoiser: its mean residual over mean radiance"
        found.append(Chart("Noise of each lamp", histogram(noise, NOISE_EDGES), note))
    if energy:
        note = "what gave back the light that the denoiser took"
        found.append(Chart("Energy factors", histogram(energy, ENERGY_EDGES), note))
    on = Counter(name for v in views for name, e in v.effects.items() if e.get("on"))
    if on:
        percent = {name.replace("_", " "): 100 * n / len(views) for name, n in on.most_common()}
        found.append(Chart("Effects that rooms call for", bars(percent, " %"), "share of views"))
    return found


def _cost(views: Sequence[ViewFacts]) -> list[Chart]:
    timed = [view.seconds for view in views if view.seconds]
    if not timed:
        return []
    steps = [s for s in STEPS if any(s in t for t in timed)]
    means = {s.replace("_", "-"): float(np.mean([t.get(s, 0.0) for t in timed])) for s in steps}
    total = [sum(t.values()) for t in timed]
    edges = np.linspace(0, float(np.ceil(max(total))), 21).tolist()
    note = f"mean of {len(timed)} views; the build is shared by the views of a room"
    return [
        Chart("CPU seconds by step", bars(means, " s"), note),
        Chart("CPU seconds a view", histogram(total, edges, " s"), "all steps"),
    ]


def _ranked(names: Iterable[str | None]) -> dict[str, float]:
    found = Counter(str(name).replace("_", " ") for name in names)
    return {name: float(count) for name, count in found.most_common(MOST_BARS)}


def _lit(lamps: Sequence[LampFacts]) -> dict[str, float]:
    kinds = [kind for kind, _ in Counter(m.kind for m in lamps).most_common()]
    return {k: 100 * float(np.mean([m.on for m in lamps if m.kind == k])) for k in kinds}
