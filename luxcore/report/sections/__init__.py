"""One file per chapter of the report; each returns a Section, or None when it has nothing yet."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from luxcore.report.content import Section
from luxcore.report.gallery import Gallery
from luxcore.report.sections import (
    captures,
    consistency,
    dataset,
    effects,
    failures,
    provenance,
    scores,
    splats,
    summary,
    training,
)

Chapter = Callable[[Path, Gallery, dict[str, Any]], Section | None]

CHAPTERS: tuple[Chapter, ...] = (
    summary.chapter,
    captures.chapter,
    consistency.chapter,
    splats.chapter,
    scores.chapter,
    failures.chapter,
    dataset.chapter,
    effects.chapter,
    training.chapter,
    provenance.chapter,
)


def all_sections(artifacts: Path, gallery: Gallery, facts: dict[str, Any]) -> Iterator[Section]:
    """Every chapter that has something to show, in reading order."""
    for chapter in CHAPTERS:
        section = chapter(artifacts, gallery, facts)
        if section is not None:
            yield section
