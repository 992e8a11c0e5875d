"""Tables for the terminal."""

from __future__ import annotations

from io import StringIO
from pathlib import Path

from flows.plan import StagePlan
from luxcore.evaluate.answers import COLUMNS, answers
from luxcore.files.json_object import read_object


def plan_table(plans: list[StagePlan]) -> str:
    """The plan as a table."""
    rows = [
        [
            p.name,
            p.state,
            "" if p.units is None else f"{p.units_missing} of {p.units}",
            "?" if p.seconds is None else f"{p.seconds:.0f} s",
            "" if p.megabytes is None else f"{p.megabytes:.1f} MB",
            p.why if len(p.why) < 90 else p.why[:87] + "…",
        ]
        for p in plans
    ]
    return _table(["stage", "state", "units missing", "time", "disk", "why"], rows)


def metrics_table(root: Path) -> str:
    """The scores that people ask for first; the report has the whole tables. Raises FormatError."""
    path = root / "artifacts" / "metrics" / "evaluate.json"
    if not path.is_file():
        return "no evaluation yet."
    rows = [list(answer.row) for answer in answers(read_object(path))]
    return _table(list(COLUMNS), rows)


def _table(columns: list[str], rows: list[list[str]]) -> str:
    from rich.console import Console
    from rich.table import Table

    table = Table(*columns)
    for row in rows:
        table.add_row(*row)
    stream = StringIO()
    Console(file=stream, width=140).print(table)
    return stream.getvalue().rstrip()
