"""Where everything on the page came from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from luxcore.report.content import Section, Table
from luxcore.report.gallery import Gallery


def chapter(artifacts: Path, gallery: Gallery, facts: dict[str, Any]) -> Section | None:
    """Revision, seed, versions; then parameters and digest of every stage."""
    stages = facts.get("stages", {})
    general = tuple(
        (name, str(value)) for name, value in facts.items() if not isinstance(value, (dict, list))
    )
    digests = tuple((name, str(stage.get("digest", "–"))) for name, stage in stages.items())
    parameters = tuple(
        (name, key, str(value))
        for name, stage in stages.items()
        for key, value in stage.get("params", {}).items()
    )
    blocks = (
        Table("This run", "", ("fact", "value"), general),
        Table("Outputs", "", ("stage", "sha256 of its files"), digests),
        Table("Parameters", "", ("stage", "parameter", "value"), parameters),
    )
    kept = tuple(block for block in blocks if block.rows)
    if not kept:
        return None
    intro = "With the same revision, seed and parameters the same files come out."
    return Section("Provenance", "provenance", intro, kept)
