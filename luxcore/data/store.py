"""Rendered views at hand: read when first needed, the latest few kept in memory."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol, runtime_checkable

from luxcore.data.compact import RenderedView, load_rendered, read_metadata
from luxcore.data.crops import ViewSource
from luxcore.errors import InputError


@runtime_checkable
class StoredView(Protocol):
    """A view that lies somewhere else than in the compact form, such as in a public shard."""

    @property
    def room(self) -> str:
        """Id of the room that it shows, without reading its pixels."""
        ...

    def load(self) -> RenderedView:
        """Read it."""
        ...


AnyView = Path | RenderedView | StoredView
"""A file stem of the compact form, a view already read, or one that can be read."""


class ViewStore:
    """Sources of photos by number. What is kept changes speed, never results."""

    def __init__(self, views: Sequence[AnyView], kept: int = 16) -> None:
        """Raises InputError when there are no views."""
        if not views:
            raise InputError("there are no rendered views to sample from.")
        self._views = list(views)
        self._kept = kept
        self._sources: OrderedDict[int, ViewSource] = OrderedDict()

    def __len__(self) -> int:
        return len(self._views)

    def source(self, number: int) -> ViewSource:
        """The view, ready for cutting."""
        if number in self._sources:
            self._sources.move_to_end(number)
            return self._sources[number]
        source = ViewSource(load_view(self._views[number]))
        self._sources[number] = source
        while len(self._sources) > self._kept:
            self._sources.popitem(last=False)
        return source

    def room(self, number: int) -> str:
        """Id of the room that a view shows, without reading its pixels."""
        return _room(self._views[number])


def by_room(views: Sequence[AnyView]) -> dict[str, list[AnyView]]:
    """The views of each room, rooms and views in the order in which they come."""
    rooms: dict[str, list[AnyView]] = {}
    for view in views:
        rooms.setdefault(_room(view), []).append(view)
    return rooms


def _room(view: AnyView) -> str:
    return str(read_metadata(view).get("room")) if isinstance(view, Path) else view.room


def load_view(view: AnyView) -> RenderedView:
    """The view, read where it lies."""
    if isinstance(view, Path):
        return load_rendered(view)
    return view if isinstance(view, RenderedView) else view.load()
