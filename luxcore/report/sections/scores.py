"""The tables and pictures of the evaluation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from luxcore.evaluate.table import COLUMNS, HEADINGS
from luxcore.report.content import Section, Strip, Table, number
from luxcore.report.gallery import Gallery
from luxcore.report.sources import read_json


def chapter(artifacts: Path, gallery: Gallery, facts: dict[str, Any]) -> Section | None:
    """Every `tables/*.json` as a table, every `pictures/*.png` as a picture."""
    folder = artifacts / "evaluate"
    blocks: list[Strip | Table] = []
    for path in sorted((folder / "tables").glob("*.json")):
        table = _table(path.stem, read_json(path))
        if table:
            blocks.append(table)
    pictures = tuple(
        gallery.copy(f"evaluate-{path.stem}", path, _title(path))
        for path in sorted((folder / "pictures").glob("*.png"))
    )
    if pictures:
        blocks.append(Strip("Pictures of the evaluation", "evaluate", pictures, columns=1))
    if not blocks:
        return None
    intro = (
        "Images are compared after AgX. “Rescaled” means one least-squares factor per colour "
        "channel in linear light first, as the paper does; baselines stand beside every method."
    )
    return Section("Tables", "tables", intro, tuple(blocks))


def _title(path: Path) -> str:
    return path.stem.replace("_", " ")


def _table(stem: str, data: dict[str, Any]) -> Table | None:
    """A table of the evaluation: {"title", "rows": [{method, cases, count, scores}], "paper"}."""
    rows = data.get("rows") or []
    if not rows:
        return None
    names = tuple(name for name in COLUMNS if any(name in row["scores"] for row in rows))
    ours = [
        (row["method"], row["cases"], str(row["count"]), *(_cell(row["scores"], n) for n in names))
        for row in rows
    ]
    papers = [
        (f"paper: {method}", "its own rooms", "", *_padded([number(v) for v in scores], len(names)))
        for method, scores in data.get("paper", {}).items()
    ]
    columns = ("method", "cases", "n", *(HEADINGS[COLUMNS.index(name)] for name in names))
    note = " ".join(line.lstrip("- ") for line in data.get("notes", []) if line)
    return Table(str(data.get("title", stem)), "evaluate", columns, (*ours, *papers), note)


def _cell(scores: dict[str, float | None], name: str) -> str:
    value = scores.get(name)
    return "–" if value is None else number(value)


def _padded(cells: list[str], width: int) -> list[str]:
    return [*cells, *[""] * (width - len(cells))]
