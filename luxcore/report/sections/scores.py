"""The tables and pictures of the evaluation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from luxcore.report.content import Section, Strip, Table, number
from luxcore.report.gallery import Gallery
from luxcore.report.sources import read_json


def chapter(artifacts: Path, gallery: Gallery, facts: dict[str, Any]) -> Section | None:
    """Every `tables/*.json` as a table, every `pictures/*.png` as a picture."""
    folder = artifacts / "evaluate"
    blocks: list[Strip | Table] = []
    for path in sorted((folder / "tables").glob("*.json")):
        table = _table(_title(path), read_json(path))
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


def _table(title: str, data: Any) -> Table | None:
    """A list of records, or {row name: {column: value}}."""
    if isinstance(data, dict) and isinstance(data.get("rows"), list):
        data = data["rows"]
    if isinstance(data, dict):
        data = [{"": name, **row} for name, row in data.items() if isinstance(row, dict)]
    records = [row for row in data or [] if isinstance(row, dict)]
    if not records:
        return None
    columns = tuple(dict.fromkeys(name for row in records for name in row))
    rows = tuple(tuple(_cell(row.get(name)) for name in columns) for row in records)
    return Table(title, "evaluate", tuple(c.replace("_", " ") for c in columns), rows)


def _cell(value: Any) -> str:
    if value is None:
        return "–"
    return number(value) if isinstance(value, (int, float)) else str(value)
