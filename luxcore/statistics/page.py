"""One HTML file about a dataset: what is in it, how noisy it is, what it cost, what stands out."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from luxcore.files.pages import write_page_from
from luxcore.statistics.charts import short
from luxcore.statistics.facts import LampFacts, ViewFacts
from luxcore.statistics.summary import charts

SHEET_QUALITY = 80
MOST_LISTED = 8


def write_page(
    path: Path, title: str, views: Sequence[ViewFacts], sheet: Float[np.ndarray, "h w 3"]
) -> Path:
    """Write `path`, which needs no other file. `sheet` is the contact sheet, display values."""
    template = Path(__file__).parent / "templates" / "statistics.html"
    return write_page_from(
        template,
        Path(path),
        title=title,
        headline=headline(views),
        sheet=_data_uri(sheet),
        charts=charts(views),
        rows=[(name, *quantiles(values)) for name, values in measures(views).items()],
        remarks=remarks(views),
    )


def headline(views: Sequence[ViewFacts]) -> dict[str, str]:
    """The counts at the top of the page."""
    rooms = {view.room: len(view.lamps) for view in views}
    sizes = sorted({f"{columns}×{rows}" for rows, columns in (v.size for v in views)})
    samples = sorted({v.spp for v in views if v.spp is not None})
    timed = [sum(v.seconds.values()) for v in views if v.seconds]
    return {
        "rooms": f"{len(rooms):,}",
        "views": f"{len(views):,}",
        "lamps": f"{sum(rooms.values()):,}",
        "pixels": ", ".join(sizes),
        "samples a pixel": ", ".join(map(str, samples)) or "not said",
        "rendered twice": f"{sum(v.topped_up is not None for v in views):,}",
        "clipped values": f"{sum(v.clipped_values for v in views):,}",
        "CPU-s a view": short(float(np.mean(timed))) if timed else "not recorded",
    }


def measures(views: Sequence[ViewFacts]) -> dict[str, list[float]]:
    """What the table of quantiles shows; a measure that no file states is left out."""
    lamps = [(view, lamp) for view in views for lamp in view.lamps]
    seen = [(view, lamp) for view, lamp in lamps if lamp.emitter_px]
    found: dict[str, list[float]] = {
        "lamps a room": [float(n) for n in {v.room: len(v.lamps) for v in views}.values()],
        "lamps in sight a view": [float(sum(_in_sight(m) for m in v.lamps)) for v in views],
        "power, W": [lamp.power_w for _, lamp in lamps],
        "emitter in sight, pixels": [float(lamp.emitter_px) for _, lamp in seen],
        "fixture in sight, pixels": [float(m.fixture_px) for _, m in lamps if m.fixture_px],
        "window, % of the view": [100 * v.window_px / _pixels(v) for v in views if v.window_px],
        "noise of a lamp": [m.noise for _, m in lamps if m.noise is not None],
        "noise of the ambient light": [
            v.ambient_noise for v in views if v.ambient_noise is not None and v.window_px
        ],
        "energy factor": [m.energy_factor for _, m in lamps if m.energy_factor is not None],
        "clipped values a view": [float(v.clipped_values) for v in views],
        "CPU-s a view": [sum(v.seconds.values()) for v in views if v.seconds],
    }
    return {name: values for name, values in found.items() if values}


def quantiles(values: Sequence[float]) -> tuple[str, ...]:
    """How many, least, 5 %, median, mean, 95 %, largest."""
    marks = np.quantile(values, [0, 0.05, 0.5, 0.95, 1])
    least, low, middle, high, most = (short(round(float(v), 6)) for v in marks)
    return f"{len(values):,}", least, low, middle, short(float(np.mean(values))), high, most


def remarks(views: Sequence[ViewFacts]) -> dict[str, list[str]]:
    """Sentences about single views and lamps that a reader should look at."""
    lamps = [(view, lamp) for view in views for lamp in view.lamps]
    noisy = sorted(((m.noise, v, m) for v, m in lamps if m.noise), key=lambda e: -e[0])
    bent = sorted(
        ((m.energy_factor, v, m) for v, m in lamps if m.energy_factor and m.energy_factor > 0),
        key=lambda e: -abs(np.log(e[0])),
    )
    clipped = sorted((v for v in views if v.clipped_values), key=lambda v: -v.clipped_values)
    lit: dict[tuple[str, str], int] = {}
    for view, lamp in lamps:
        key = (view.room, lamp.name)
        lit[key] = lit.get(key, 0) + _in_sight(lamp)
    hidden = [f"{room}: {name}" for (room, name), seen in sorted(lit.items()) if not seen]
    found = {
        "Noisiest lights": [f"{_where(v, m)}: {short(n)}" for n, v, m in noisy[:MOST_LISTED]],
        "Energy factors farthest from 1": [
            f"{_where(v, m)}: {short(f)}" for f, v, m in bent[:MOST_LISTED]
        ],
        "Most clipped values": [f"{v.name}: {v.clipped_values:,}" for v in clipped[:MOST_LISTED]],
        f"Lamps that no view of their room shows ({len(hidden)} of {len(lit)})": hidden[
            :MOST_LISTED
        ],
    }
    return {title: lines for title, lines in found.items() if lines}


def _where(view: ViewFacts, lamp: LampFacts) -> str:
    return f"{view.name}, {lamp.name} ({lamp.design or lamp.kind})"


def _in_sight(lamp: LampFacts) -> bool:
    return lamp.emitter_px + lamp.fixture_px > 0


def _pixels(view: ViewFacts) -> int:
    return view.size[0] * view.size[1]


def _data_uri(sheet: np.ndarray) -> str:
    from PIL import Image

    stream = io.BytesIO()
    pixels = np.round(np.clip(sheet, 0, 1) * 255).astype(np.uint8)
    Image.fromarray(pixels).save(stream, format="JPEG", quality=SHEET_QUALITY)
    return "data:image/jpeg;base64," + base64.b64encode(stream.getvalue()).decode()
