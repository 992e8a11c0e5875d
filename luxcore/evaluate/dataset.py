"""Which rendered views of a dataset folder are evaluated on."""

from __future__ import annotations

from pathlib import Path

from luxcore.data.compact import list_rendered
from luxcore.errors import InputError


def evaluation_views(dataset: Path) -> list[Path]:
    """Stems of the views below `dataset`, of its `test` folder where it has one."""
    dataset = Path(dataset)
    if not dataset.is_dir():
        raise InputError(f"{dataset} is not a folder.")
    test = dataset / "test"
    return list_rendered(test if test.is_dir() else dataset)
