"""Which rendered views of a dataset are evaluated on, whatever layout it has."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from luxcore.data.layouts import views_in
from luxcore.data.store import AnyView
from luxcore.errors import InputError


def evaluation_views(dataset: Path) -> Sequence[AnyView]:
    """The views at `dataset` (of its `test` folder where it has one), see `views_in`.

    Raises InputError when there are none.
    """
    dataset = Path(dataset)
    if not dataset.exists():
        raise InputError(f"{dataset} does not exist.")
    return views_in(dataset / "test" if (dataset / "test").is_dir() else dataset)
