"""Where training scenes come from: rendered rooms, or sketches to try a training out."""

from __future__ import annotations

from dataclasses import dataclass

from luxcore.errors import InputError
from luxcore.models.small.samples import LitGroups, LitView
from luxcore.settings.paper_models import DataSettings

SKETCHED_ROOMS = 1000


@dataclass(frozen=True)
class KindedView(LitView):
    """A photo whose light is known, and the kind of each lamp as its dataset calls it."""

    kinds: tuple[str, ...]


def open_groups(settings: DataSettings) -> LitGroups:
    """Scenes by number. Raises InputError when the folder of rendered rooms is absent."""
    if settings.source == "sketch":
        from luxcore.models.small.sketch import SketchRooms

        return SketchRooms(SKETCHED_ROOMS, settings.side, seed=0)
    raise InputError("not yet")
