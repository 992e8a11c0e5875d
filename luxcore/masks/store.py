"""Which pixels of which view are which lamp, on disk.

lamps.json     [{index, name, on, references, areas, truth_light}]
0003_00.png    lamp 0 in view 3; only views where it is visible
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool

from luxcore.errors import FormatError, InputError
from luxcore.files.atomic import write_json
from luxcore.files.json_numbers import flag
from luxcore.files.photos import read_mask, write_png

Mask = Bool[np.ndarray, "h w"]


@dataclass(frozen=True)
class Lamp:
    """One switch of the room."""

    index: int
    name: str
    on: bool
    """Whether it shone when the photos were taken."""
    references: tuple[int, ...]
    """Views that show it best, best first."""
    areas: Mapping[int, int]
    """Pixels of its mask by view; a view that is not listed does not see it."""
    truth_light: int | None = None
    """Which light of the capture's truth it is, where that is known."""


@dataclass(frozen=True)
class LampMasks:
    """The masks stage's result for one capture."""

    root: Path
    lamps: tuple[Lamp, ...]

    def path(self, view: int, lamp: int) -> Path:
        """The PNG of a lamp in a view, whether or not it exists."""
        return self.root / mask_name(view, lamp)

    def mask(self, view: int, lamp: int) -> Mask | None:
        """[h, w] bool, or None where the view does not see the lamp."""
        if view not in self.lamps[lamp].areas:
            return None
        return read_mask(self.path(view, lamp))


@dataclass(frozen=True)
class FoundLamp:
    """A lamp before it is written: its mask in each view that sees it."""

    name: str
    on: bool
    masks: Mapping[int, Mask]
    references: tuple[int, ...]
    truth_light: int | None = field(default=None)


def mask_name(view: int, lamp: int) -> str:
    """`0003_00.png`: view first, then lamp."""
    return f"{view:04d}_{lamp:02d}.png"


def write_masks(folder: Path, lamps: Iterable[FoundLamp]) -> LampMasks:
    """Write masks and lamps.json into `folder`, which is new and empty."""
    records: list[dict[str, Any]] = []
    for index, lamp in enumerate(lamps):
        for view, mask in lamp.masks.items():
            write_png(folder / mask_name(view, index), mask)
        records.append(
            {
                "index": index,
                "name": lamp.name,
                "on": lamp.on,
                "references": list(lamp.references),
                "areas": {str(v): int(m.sum()) for v, m in lamp.masks.items()},
                "truth_light": lamp.truth_light,
            }
        )
    write_json(folder / "lamps.json", records)
    return load_masks(folder)


def load_masks(folder: Path) -> LampMasks:
    """Read lamps.json. Raises InputError or FormatError naming the file and the fact."""
    path = Path(folder) / "lamps.json"
    if not path.is_file():
        raise InputError(f"{path} does not exist.")
    try:
        records = json.loads(path.read_text(encoding="utf-8"))
        lamps = tuple(_lamp(record) for record in records)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise FormatError(f"{path} is not a list of lamps: {error!r}.") from error
    if [lamp.index for lamp in lamps] != list(range(len(lamps))):
        raise FormatError(f"{path} must number its lamps 0, 1, 2, … in order.")
    masks = LampMasks(Path(folder), lamps)
    for lamp in lamps:
        for view in lamp.areas:
            if not masks.path(view, lamp.index).is_file():
                raise FormatError(f"{masks.path(view, lamp.index)} does not exist.")
    return masks


def _lamp(record: dict[str, Any]) -> Lamp:
    return Lamp(
        index=int(record["index"]),
        name=str(record["name"]),
        on=flag(record["on"], "on"),
        references=tuple(int(v) for v in record["references"]),
        areas={int(v): int(a) for v, a in record["areas"].items()},
        truth_light=record.get("truth_light"),
    )
