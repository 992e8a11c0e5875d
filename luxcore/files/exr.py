"""OpenEXR: one named part per layer, read and written as float arrays, hostile headers refused."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from luxcore.errors import FormatError, InputError
from luxcore.files.atomic import atomic_file

MAX_SIDE = 32_768
"""Largest width or height, in pixels, that a header may claim before anything is allocated."""

HALF_MAX = 65_504.0
_RGB = {1: "Y", 3: "RGB", 4: "RGBA"}


@cache
def _library() -> Any:
    import OpenEXR

    # Without this a 98 kB file that claims 100,000² pixels makes the library try 112 GiB.
    OpenEXR.setMaxImageSize(MAX_SIDE, MAX_SIDE)
    OpenEXR.setMaxTileSize(MAX_SIDE, MAX_SIDE)
    return OpenEXR


def write_exr(path: Path, layers: Mapping[str, np.ndarray], *, half: bool = True) -> int:
    """Write each layer ([H, W] or [H, W, 1|3|4]) as one part; ZIP, half or float32.

    Returns the number of values that half precision had to clip to ±65504.
    Depth-like layers that must not lose precision: pass float64 arrays' layers with `half=False`.
    Raises InputError when a layer is empty, not finite, or of a different size than the others.
    """
    exr = _library()
    parts, clipped, size = [], 0, None
    for name, layer in layers.items():
        pixels = np.asarray(layer, np.float32)
        pixels = pixels[..., None] if pixels.ndim == 2 else pixels
        _check_layer(path, name, pixels, size)
        size = pixels.shape[:2]
        if half:
            clipped += int(np.count_nonzero(np.abs(pixels) > HALF_MAX))
            pixels = np.clip(pixels, -HALF_MAX, HALF_MAX).astype(np.float16)
        channels = {
            c: np.ascontiguousarray(pixels[..., i]) for i, c in enumerate(_RGB[pixels.shape[2]])
        }
        header = {"compression": exr.ZIP_COMPRESSION, "type": exr.scanlineimage, "name": name}
        parts.append(exr.Part(header, channels, name=name))
    if not parts:
        raise InputError(f"{path} would hold no layers.")
    with atomic_file(Path(path)) as temporary:
        exr.File(parts).write(str(temporary))
    return clipped


def read_exr(path: Path) -> dict[str, np.ndarray]:
    """Layers by part name, each [H, W, C] float32, C in 1, 3, 4 (channels R, G, B, A or Y first).

    A single unnamed part is called "image". Raises FormatError naming the file and the fact.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path} does not exist.")
    try:
        file = _library().File(str(path), separate_channels=True)
        parts = list(file.parts)
        layers = {(p.name() or "image"): _part_pixels(path, p) for p in parts}
    except (RuntimeError, ValueError, IndexError, MemoryError) as error:
        raise FormatError(f"{path} is not a readable OpenEXR image: {error}.") from error
    if not layers:
        raise FormatError(f"{path} is truncated or damaged: it holds no readable part.")
    return layers


def read_exr_image(path: Path) -> np.ndarray:
    """The first layer of an EXR as [H, W, 3] float32 linear radiance."""
    pixels = next(iter(read_exr(path).values()))
    return np.repeat(pixels, 3, axis=2) if pixels.shape[2] == 1 else pixels[..., :3]


def _part_pixels(path: Path, part: Any) -> np.ndarray:
    channels = {name.split(".")[-1].upper(): c.pixels for name, c in part.channels.items()}
    if not channels:
        raise FormatError(f"{path} has a part without channels.")
    wanted = [c for c in "RGBA" if c in channels] or list(channels)[:1]
    planes = [np.asarray(channels[c], np.float32) for c in wanted]
    if len({p.shape for p in planes}) != 1 or planes[0].ndim != 2 or 0 in planes[0].shape:
        raise FormatError(f"{path} has channels of different or unusable sizes.")
    return np.stack(planes, axis=-1)


def _check_layer(path: Path, name: str, pixels: np.ndarray, size: tuple | None) -> None:
    if pixels.ndim != 3 or pixels.shape[2] not in _RGB or pixels.size == 0:
        raise InputError(
            f"{path}: layer {name} must be [H, W] or [H, W, 1|3|4], got {pixels.shape}."
        )
    if size is not None and pixels.shape[:2] != size:
        raise InputError(f"{path}: layer {name} is {pixels.shape[:2]}, the others are {size}.")
    if not np.isfinite(pixels).all():
        raise InputError(f"{path}: layer {name} has values that are not finite.")
