"""What a training tells the outside: numbers and pictures. Who listens is not its matter."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from luxcore.files.photos import write_png


@runtime_checkable
class Listener(Protocol):
    """Receives what a training reports, on the first device only."""

    def metrics(self, step: int, values: Mapping[str, float]) -> None:
        """Numbers of a step (1 is the first), by name."""
        ...

    def picture(self, step: int, name: str, image: Float[np.ndarray, "h w 3"]) -> None:
        """A validation picture, display-referred in 0..1."""
        ...


class FolderListener:
    """Keeps metrics as JSON lines in `metrics.jsonl` and pictures as PNG files of a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def metrics(self, step: int, values: Mapping[str, float]) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        line = json.dumps({"step": step, **values}, sort_keys=True)
        with open(self.folder / "metrics.jsonl", "a", encoding="utf-8") as stream:
            stream.write(line + "\n")

    def picture(self, step: int, name: str, image: Float[np.ndarray, "h w 3"]) -> None:
        write_png(self.folder / "pictures" / f"{step:08d}_{name}.png", image)
