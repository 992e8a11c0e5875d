"""A decomposition on disk: one EXR per light, linear, and lights.json.

ambient.exr, light_00.exr, …   in the order of the masks
lights.json                    scale, on, names, exposure, recomposition_db
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool

from luxcore.decompose.photo import PhotoLight
from luxcore.errors import FormatError
from luxcore.files.atomic import write_json
from luxcore.files.exr import HALF_MAX, read_exr_image, write_exr
from luxcore.files.json_object import read_object
from luxcore.models.interface import Decomposition


@dataclass(frozen=True)
class StoredLight:
    """A decomposition read back; `known[k]`: lamp k was in sight, so its light means something."""

    light: Decomposition
    on: Bool[np.ndarray, " k"]
    known: Bool[np.ndarray, " k"]
    exposure: float


def write_light(
    folder: Path,
    result: PhotoLight,
    names: Sequence[str],
    exposure: float,
    known: Bool[np.ndarray, " k"],
) -> None:
    """Write a decomposition; half precision where it holds every value, else float32."""
    layers = {"ambient": result.light.ambient}
    layers |= {f"light_{i:02d}": olat for i, olat in enumerate(result.light.olat)}
    for name, pixels in layers.items():
        half = bool(np.abs(pixels).max(initial=0) <= HALF_MAX)
        write_exr(folder / f"{name}.exr", {name: pixels}, half=half)
    about = {
        "scale": np.round(result.light.scale.astype(float), 6).tolist(),
        "on": result.on.tolist(),
        "known": known.tolist(),
        "names": list(names),
        "exposure": exposure,
        "recomposition_db": round(result.recomposition_db, 3),
    }
    write_json(folder / "lights.json", about)


def read_light(folder: Path) -> StoredLight:
    """The inverse of `write_light`. Raises InputError or FormatError naming the file."""
    path = Path(folder) / "lights.json"
    about = read_object(path)
    try:
        scale = np.array(about["scale"], np.float32).reshape(-1, 3)
        on, known = np.array(about["on"], bool), np.array(about["known"], bool)
        exposure = float(about["exposure"])
    except (KeyError, TypeError, ValueError) as error:
        raise FormatError(f"{path} lacks a usable {error}.") from error
    ambient = read_exr_image(folder / "ambient.exr")
    olats = [read_exr_image(folder / f"light_{i:02d}.exr") for i in range(len(scale))]
    olat = np.stack(olats) if olats else np.zeros((0, *ambient.shape), np.float32)
    return StoredLight(Decomposition(ambient, olat, scale), on, known, exposure)
