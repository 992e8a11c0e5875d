"""Write the report: index.html beside a folder of pictures, readable from disk and printed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from luxcore.errors import InputError
from luxcore.files.pages import write_page_from
from luxcore.report.gallery import Gallery
from luxcore.report.sections import all_sections


def write_report(artifacts: Path, out: Path, provenance: dict[str, Any]) -> Path:
    """Write `out`/index.html and `out`/pictures/ from the stages' folders below `artifacts`.

    provenance: {"revision", "seed", … , "stages": {stage: {"digest", "params": {…}}}}; what is
    known of a stage is printed under each of its figures. Stages that have not run are left out.
    Returns the path of index.html. Raises InputError when `artifacts` holds nothing to show.
    """
    artifacts, out = Path(artifacts), Path(out)
    sections = list(all_sections(artifacts, Gallery(out), provenance))
    if not any(section.anchor != "provenance" for section in sections):
        raise InputError(f"{artifacts} holds no results of any stage to report.")
    templates = Path(__file__).parent / "templates"
    css = (templates / "report.css").read_text(encoding="utf-8")
    return write_page_from(
        templates / "report.html",
        out / "index.html",
        sections=sections,
        facts=provenance,
        stages=provenance.get("stages", {}),
        css=css,
        extras=_extras(out),
    )


def _extras(out: Path) -> list[str]:
    """Other pages of the folder, linked from the top: an explorer per photo, the trade-offs."""
    return sorted(
        str(path.relative_to(out)) for path in out.rglob("*.html") if path.name != "index.html"
    )
