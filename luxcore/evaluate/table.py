"""Tables of scores as JSON and Markdown, in the paper's form: PSNR, SSIM, LPIPS."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from luxcore.files.atomic import atomic_file, write_json

COLUMNS = ("psnr", "ssim", "lpips", "psnr_picture", "psnr_unscaled", "ssim_unscaled", "log_rmse")
HEADINGS = (
    "PSNR",
    "SSIM",
    "LPIPS",
    "PSNR, picture scaled",
    "PSNR unscaled",
    "SSIM unscaled",
    "error in stops",
)
DIGITS = (2, 3, 3, 2, 2, 3, 2)

PAPER_SINGLE = {
    "ScribbleLight": (14.39, 0.395, 0.688),
    "Qwen-Image": (18.23, 0.714, 0.237),
    "FLUX token": (25.20, 0.865, 0.101),
    "SD": (27.13, 0.857, 0.099),
    "LuxRemix-SV": (27.68, 0.898, 0.082),
}
PAPER_MULTI = {
    "LuxRemix-SV per view": (25.14, 0.807, 0.149),
    "MV-Edit": (26.37, 0.794, 0.136),
    "LuxRemix-MV": (30.76, 0.867, 0.091),
}
"""The paper's own figures, on its own 30 rooms: beside ours for scale, not for comparison."""


@dataclass(frozen=True)
class Row:
    """Mean scores of one method over one set of cases; None where a score is unavailable."""

    method: str
    cases: str
    count: int
    scores: dict[str, float | None]


def mean_row(method: str, cases: str, scores: Sequence[Mapping[str, float | None]]) -> Row:
    """The mean of each score over the cases that have it."""
    means: dict[str, float | None] = {}
    for column in COLUMNS:
        values = [v for s in scores if (v := s.get(column)) is not None]
        means[column] = round(float(np.mean(values)), 4) if values else None
    return Row(method, cases, len(scores), means)


def write_table(
    folder: Path,
    name: str,
    title: str,
    rows: Sequence[Row],
    paper: Mapping[str, tuple[float, float, float]],
    notes: Sequence[str] = (),
) -> None:
    """`folder/name.json` and `folder/name.md`."""
    record = {
        "title": title,
        "rows": [asdict(row) for row in rows],
        "paper": {method: list(scores) for method, scores in paper.items()},
        "notes": list(notes),
    }
    write_json(folder / f"{name}.json", record)
    with atomic_file(folder / f"{name}.md") as temporary:
        temporary.write_text(_markdown(title, rows, paper, notes), encoding="utf-8")


def flat_metrics(prefix: str, rows: Sequence[Row]) -> dict[str, float]:
    """`prefix_method_cases_score` → number, names in lower case with underscores."""
    return {
        "_".join((prefix, *_words(row.method), *_words(row.cases), score)): value
        for row in rows
        for score, value in row.scores.items()
        if value is not None
    }


def headlines(metrics: Mapping[str, float]) -> dict[str, float]:
    """The metrics worth a glance: PSNR of each row, and what no table holds."""
    beside = tuple(f"_{column}" for column in COLUMNS if column != "psnr")
    return {name: value for name, value in metrics.items() if not name.endswith(beside)}


def _words(text: str) -> list[str]:
    return "".join(c if c.isalnum() else " " for c in text.lower()).split()


def _markdown(
    title: str,
    rows: Sequence[Row],
    paper: Mapping[str, tuple[float, float, float]],
    notes: Sequence[str],
) -> str:
    lines = [f"# {title}", "", f"| method | cases | n | {' | '.join(HEADINGS)} |"]
    lines.append("|---|---|---|" + "---|" * len(HEADINGS))
    for row in rows:
        cells = [_cell(row.scores[c], d) for c, d in zip(COLUMNS, DIGITS, strict=True)]
        lines.append(f"| {row.method} | {row.cases} | {row.count} | {' | '.join(cells)} |")
    for method, scores in paper.items():
        cells = [_cell(s, d) for s, d in zip(scores, DIGITS, strict=False)]
        blank = [""] * (len(HEADINGS) - len(cells))
        lines.append(f"| *paper: {method}* | its own rooms | | {' | '.join([*cells, *blank])} |")
    return "\n".join([*lines, "", *notes, ""])


def _cell(value: float | None, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}f}"
