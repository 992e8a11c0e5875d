"""Which rendered views of a dataset are evaluated on, whatever layout it has."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from luxcore.data.compact import holds_compact, list_rendered
from luxcore.data.store import AnyView
from luxcore.errors import InputError


def evaluation_views(dataset: Path) -> Sequence[AnyView]:
    """The views at `dataset` (of its `test` folder where it has one), in the compact form or in
    the public layout: a shard, a scene, or a folder of either; nothing is unpacked.

    Raises InputError when there are none.
    """
    dataset = Path(dataset)
    if not dataset.exists():
        raise InputError(f"{dataset} does not exist.")
    root = dataset / "test" if (dataset / "test").is_dir() else dataset
    if holds_compact(root):
        return list_rendered(root)
    from luxcore.data.public_reader import public_views

    return public_views(root)
