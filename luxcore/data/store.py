"""Rendered views at hand: read when first needed, the latest few kept in memory."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path

from luxcore.data.compact import RenderedView, load_rendered, read_metadata
from luxcore.data.crops import ViewSource
from luxcore.errors import InputError


class ViewStore:
    """Sources of photos by number. What is kept changes speed, never results."""

    def __init__(self, views: Sequence[Path | RenderedView], kept: int = 16) -> None:
        """`views`: file stems of the compact form, or views already read."""
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
        view = self._views[number]
        source = ViewSource(view if isinstance(view, RenderedView) else load_rendered(view))
        self._sources[number] = source
        while len(self._sources) > self._kept:
            self._sources.popitem(last=False)
        return source

    def room(self, number: int) -> str:
        """Id of the room that a view shows, without reading its pixels."""
        view = self._views[number]
        if isinstance(view, RenderedView):
            return view.room
        return str(read_metadata(view).get("room"))
