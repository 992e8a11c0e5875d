"""Finds what the stages left behind. Everything is optional: a report can be made at any time."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from luxcore.errors import FormatError
from luxcore.files.exr import read_exr
from luxcore.files.photos import read_mask, read_photo

T = TypeVar("T")


def read_json(path: Path) -> Any:
    """Parsed JSON, or None where the file is not there. Raises FormatError."""
    if not path.is_file():
        return None
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise FormatError(f"{path} is not readable JSON: {error}.") from error


def spread(items: Sequence[T], count: int) -> list[T]:
    """At most `count` items, evenly spaced, the first and the last among them."""
    if len(items) <= count:
        return list(items)
    picks = np.linspace(0, len(items) - 1, count).round().astype(int)
    return [items[i] for i in picks]


def light_names(layers: dict[str, np.ndarray]) -> list[str]:
    """`light_00`, `light_01` … in order."""
    return sorted(name for name in layers if name.startswith("light_"))


@dataclass(frozen=True)
class CaptureFiles:
    """One capture across the stages; methods return None where a stage has not run."""

    artifacts: Path
    id: str

    def folder(self, stage: str) -> Path:
        return self.artifacts / stage / self.id

    @cached_property
    def about(self) -> dict[str, Any]:
        return read_json(self.folder("capture") / "capture.json") or {}

    @cached_property
    def images(self) -> list[Path]:
        return sorted((self.folder("capture") / "images").glob("*.png"))

    @cached_property
    def lamps(self) -> list[dict[str, Any]]:
        found = read_json(self.folder("masks") / "lamps.json") or []
        return found["lamps"] if isinstance(found, dict) else found

    @cached_property
    def exposure(self) -> float:
        """The factor g of AgX(g · radiance) that the stages used for this capture."""
        fused = read_json(self.folder("fuse") / "fuse.json") or {}
        return float(fused.get("exposure") or self.about.get("exposure") or 1.0)

    @cached_property
    def references(self) -> list[int]:
        """Views that were decomposed, in order."""
        folders = self.folder("decompose").glob("[0-9]*/ambient.exr")
        return sorted(int(f.parent.name) for f in folders)

    def lamp_name(self, index: int) -> str:
        names = {lamp["index"]: str(lamp["name"]) for lamp in self.lamps}
        return names.get(index, f"lamp {index}")

    def photo(self, view: int) -> np.ndarray:
        return read_photo(self.images[view])

    def masks(self, view: int) -> dict[int, np.ndarray]:
        files = self.folder("masks").glob(f"{view:04d}_*.png")
        return {int(f.stem.split("_")[1]): read_mask(f) for f in files}

    def fused(self, view: int) -> dict[str, np.ndarray] | None:
        return _layers(self.folder("fuse") / f"{view:04d}.exr")

    def truth(self, view: int) -> dict[str, np.ndarray] | None:
        """The true light of every lamp as it shone in the photo, in the order of the masks."""
        folder = self.folder("capture") / "truth"
        layers, about = _layers(folder / f"{view:04d}.exr"), read_json(folder / "lights.json")
        if layers is None or about is None:
            return None
        found = {"ambient": layers["ambient"]}
        for lamp in self.lamps:
            index = lamp.get("truth_light", lamp["index"])
            if index is not None:
                scale = np.asarray(about["lamps"][index]["scale"], np.float32)
                found[f"light_{lamp['index']:02d}"] = layers[f"light_{index:02d}"] * scale
        return found

    def decomposed(self, view: int) -> dict[str, np.ndarray] | None:
        """Ambient and lamps of the single-view model, in the layout of `fused`."""
        folder = self.folder("decompose") / f"{view:04d}"
        files = sorted(folder.glob("ambient.exr")) + sorted(folder.glob("light_*.exr"))
        return {f.stem: next(iter(read_exr(f).values())) for f in files} or None

    def scales(self, view: int) -> np.ndarray | None:
        """[k, 3] linear RGB of every lamp in the photo, by the decomposition of `view`."""
        lights = read_json(self.folder("decompose") / f"{view:04d}" / "lights.json")
        return None if lights is None else np.asarray(lights["scale"], float)


def find_captures(artifacts: Path) -> list[CaptureFiles]:
    """Captures by id."""
    found = sorted((artifacts / "capture").glob("*/capture.json"))
    return [CaptureFiles(artifacts, path.parent.name) for path in found]


def _layers(path: Path) -> dict[str, np.ndarray] | None:
    return read_exr(path) if path.is_file() else None
