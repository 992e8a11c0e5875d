"""Long fits as units: finished ones are reused, killed ones resume from their checkpoint."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from tasks.context import StageContext


def resumable_unit(
    stage: StageContext, name: str, key: str, fit: Callable[[Path, Path], None]
) -> Path:
    """Copy the unit of `key` to the stage's folder `name`; `fit(out, checkpoint)` where missing.

    The checkpoint lives beside the units, where neither DVC nor a new run empties it.
    """
    folder = stage.store.get(key)
    if folder is None:
        checkpoint = stage.store.root / "checkpoints" / key
        folder = stage.store.put(key, lambda out: fit(out, checkpoint))
        shutil.rmtree(checkpoint, ignore_errors=True)
    target = stage.out / name
    shutil.copytree(folder, target, ignore=shutil.ignore_patterns("manifest.json"))
    return target
