"""First page: the scores that matter and what each stage cost."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from luxcore.evaluate.answers import COLUMNS, answers
from luxcore.report.content import Section, Strip, Table
from luxcore.report.gallery import Gallery
from luxcore.report.sources import read_json


def chapter(artifacts: Path, gallery: Gallery, facts: dict[str, Any]) -> Section | None:
    """Headline metrics and the time and memory of every stage."""
    blocks: list[Strip | Table] = []
    metrics = read_json(artifacts / "evaluate" / "metrics.json") or {}
    if found := answers(metrics):
        rows = tuple(answer.row for answer in found)
        note = "PSNR on AgX pictures, light scaled channel by channel; all scores are under Tables."
        blocks.append(Table("How close to the truth", "evaluate", COLUMNS, rows, note=note))
    timings = {
        path.stem: read_json(path) for path in sorted((artifacts / "timings").glob("*.json"))
    }
    if timings:
        blocks.append(_costs(timings))
    if not blocks:
        return None
    intro = "What this run reached, and what it cost. Every number is from this run's own files."
    return Section("Summary", "summary", intro, tuple(blocks))


def _costs(timings: dict[str, dict[str, Any]]) -> Table:
    ordered = sorted(timings.items(), key=lambda item: -item[1].get("wall_s", 0))
    rows = tuple(
        (name, f"{t.get('wall_s', 0):.1f}", f"{t.get('peak_memory_mb', 0):.0f}")
        for name, t in ordered
    )
    total = sum(t.get("wall_s", 0) for t in timings.values())
    return Table(
        "What each stage cost",
        "",
        ("stage", "seconds (wall)", "peak memory, MB"),
        rows,
        note=f"{total:.0f} s in all, each stage by its last execution.",
    )
