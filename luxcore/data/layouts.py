"""Rendered views in whichever layout they lie."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from luxcore.data.compact import holds_compact, list_rendered
from luxcore.data.public_reader import public_views
from luxcore.data.store import AnyView


def views_in(root: Path) -> Sequence[AnyView]:
    """The views at `root`, in the compact form or in the public layout: a shard, a scene, or a
    folder of either; nothing is unpacked.

    Raises InputError when there are none.
    """
    return list_rendered(root) if holds_compact(root) else public_views(root)
