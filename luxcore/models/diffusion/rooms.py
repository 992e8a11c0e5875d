"""Where training photos come from: rendered rooms, cut and newly lit as they are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol, runtime_checkable

from luxcore.data.crops import LitCrop
from luxcore.data.layouts import views_in
from luxcore.data.multiview import MultiViewSets
from luxcore.data.store import AnyView
from luxcore.data.training import SingleViewSamples
from luxcore.errors import InputError
from luxcore.settings.paper_models import DataSettings

ATTEMPTS = 100
"""Photos drawn until one shows a lamp."""

NEXT_DRAW = 2**48
"""Numbers of a position's further draws lie this far apart: beyond every position of a run."""


@runtime_checkable
class LitPhotos(Protocol):
    """Photos whose light is known, by number; the target lamp is lamp 0."""

    def crop(self, index: int) -> LitCrop: ...


@runtime_checkable
class LitSets(Protocol):
    """Overlapping photos of one room under one light, by number; the target lamp is lamp 0."""

    def crops(self, index: int, views: int) -> list[LitCrop]: ...


def open_photos(settings: DataSettings, seed: int) -> SingleViewSamples:
    """Single photos. Raises InputError when the folder holds no rendered views."""
    return SingleViewSamples(_views(settings), (settings.side, settings.side), seed)


def open_sets(settings: DataSettings, seed: int) -> MultiViewSets:
    """Sets of photos. Raises InputError when the folder holds no rendered views."""
    return MultiViewSets(_views(settings), (settings.side, settings.side), seed)


def photo_with_lamp(photos: LitPhotos, position: int) -> LitCrop:
    """The first photo of a position's draws that shows a lamp."""
    for attempt in range(ATTEMPTS):
        crop = photos.crop(position + attempt * NEXT_DRAW)
        if len(crop.on):
            return crop
    raise InputError(f"none of {ATTEMPTS} training photos shows a lamp.")


def set_with_lamp(sets: LitSets, position: int, views: int) -> list[LitCrop]:
    """The first set of a position's draws in which a lamp is seen; at most `views` photos."""
    for attempt in range(ATTEMPTS):
        crops = sets.crops(position + attempt * NEXT_DRAW, views)[:views]
        if len(crops[0].on):
            return crops
    raise InputError(f"none of {ATTEMPTS} sets of training photos shows a lamp.")


def _views(settings: DataSettings) -> Sequence[AnyView]:
    if not settings.root:
        raise InputError("training needs rendered rooms: set data.root to their folder.")
    return views_in(Path(settings.root).expanduser())
