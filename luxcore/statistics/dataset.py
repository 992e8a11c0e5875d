"""The page of a folder: rendered views in the compact form, or scenes of the public layout."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from luxcore.data.compact import holds_compact, list_rendered
from luxcore.data.public_reader import PublicView, public_views
from luxcore.data.store import AnyView
from luxcore.progress import progress
from luxcore.statistics.contact_sheet import contact_sheet, save_sheet
from luxcore.statistics.facts import Seconds, ViewFacts, facts_of_files, facts_of_view
from luxcore.statistics.page import write_page

PAGE, SHEET = "statistics.html", "contact_sheet.png"


def write_statistics(
    path: Path, out: Path, *, title: str = "", seconds: Mapping[str, Seconds] | None = None
) -> list[ViewFacts]:
    """Write statistics.html and contact_sheet.png about all views at `path` into `out`.

    `path` is a folder of either form, or one shard. `seconds` are CPU seconds by step of views of
    the compact form, by their names below `path`. Raises InputError when there are no views.
    """
    found = _open(Path(path))
    facts = []
    with progress("statistics", len(found), "views") as bar:
        for name, view in found:
            if isinstance(view, PublicView):
                facts.append(facts_of_view(view.load(), name))
            else:
                facts.append(facts_of_files(view, name, (seconds or {}).get(name)))
            bar.advance()
    views: list[AnyView] = [view for _, view in found]
    sheet = contact_sheet(views)
    save_sheet(out / SHEET, sheet)
    write_page(out / PAGE, title or Path(path).resolve().name, facts, sheet)
    return facts


def _open(path: Path) -> list[tuple[str, Path | PublicView]]:
    if holds_compact(path):
        return [(str(stem.relative_to(path)), stem) for stem in list_rendered(path)]
    return [(f"{view.room}, view {view.view}", view) for view in public_views(path)]
