"""What a section of the report is made of. Files are relative to the report's folder."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Picture:
    """One image file and the words under it."""

    file: str
    caption: str


@dataclass(frozen=True)
class Strip:
    """Pictures side by side, from one stage."""

    title: str
    stage: str
    pictures: tuple[Picture, ...]
    columns: int = 0
    """Pictures per row; 0 lets the page decide."""
    note: str = ""
    kind: str = "strip"


@dataclass(frozen=True)
class Table:
    """Rows of text and numbers, from one stage."""

    title: str
    stage: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    kind: str = "table"


@dataclass(frozen=True)
class Section:
    """A chapter of the page."""

    title: str
    anchor: str
    intro: str
    blocks: tuple[Strip | Table, ...] = field(default=())


def number(value: int | float) -> str:
    """A number for a table: four significant digits, integers as they are."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if float(value).is_integer() and abs(value) < 1e9:
        return f"{int(value)}"
    return f"{value:.4g}"
