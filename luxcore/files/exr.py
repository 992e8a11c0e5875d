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

MAX_PARTS, MAX_CHANNELS = 256, 64
MAX_EXPANSION = 1_100
"""Most bytes of pixels per byte of file: zlib, the tightest of the codecs, cannot pass 1,032."""

HALF_MAX = 65_504.0
_HALF_ZERO = 2.0**-25
"""Half precision rounds this and everything smaller to 0."""
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

    Returns the number of values that half precision had to clip to ±65504 or let vanish to 0.
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
            size_of = np.abs(pixels)
            lost = (size_of > HALF_MAX) | ((size_of > 0) & (size_of <= _HALF_ZERO))
            clipped += int(np.count_nonzero(lost))
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


def read_exr(path: Path, *, finite: bool = True) -> dict[str, np.ndarray]:
    """Layers by part name, each [H, W, C] float32, C in 1, 3, 4 (channels R, G, B, A or Y first).

    A single unnamed part is called "image"; what is read is the data window, wherever it lies in
    the display window. With `finite`, NaN and infinity are damage. Raises InputError (missing) or
    FormatError, naming the file and the fact, before memory is taken for what a header claims.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path} does not exist.")
    try:
        _check_header(path)
        parts = list(_library().File(str(path), separate_channels=True).parts)
        layers = {(p.name() or "image"): _part_pixels(path, p) for p in parts}
    except (RuntimeError, ValueError, IndexError, MemoryError, UnicodeDecodeError) as error:
        fact = " ".join(str(error).split())
        raise FormatError(f"{path} is not a readable OpenEXR image: {fact}.") from error
    if not layers:
        raise FormatError(f"{path} is truncated or damaged: it holds no readable part.")
    if len(layers) != len(parts):
        raise FormatError(f"{path} holds two parts of the same name.")
    if finite:
        _check_finite(path, layers)
    return layers


def read_exr_image(path: Path) -> np.ndarray:
    """The first layer of an EXR as [H, W, 3] float32 linear radiance."""
    pixels = next(iter(read_exr(path).values()))
    return np.repeat(pixels, 3, axis=2) if pixels.shape[2] == 1 else pixels[..., :3]


def _check_header(path: Path) -> None:
    """Refuse what the header alone shows to be hostile. Raises FormatError."""
    exr = _library()
    headers = [part.header for part in exr.File(str(path), header_only=True).parts]
    if len(headers) > MAX_PARTS:
        raise FormatError(f"{path} claims {len(headers)} parts, too many.")
    claimed = 0
    for header in headers:
        if header.get("type") not in (exr.scanlineimage, exr.tiledimage):
            raise FormatError(f"{path} is a deep image, which is not supported.")
        low, high = (np.asarray(corner, np.int64) for corner in header["dataWindow"])
        width, height = (int(n) for n in high - low + 1)
        if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
            raise FormatError(f"{path} claims {width}x{height} pixels, which cannot be used.")
        channels = header["channels"]
        if len(channels) > MAX_CHANNELS:
            raise FormatError(f"{path} claims {len(channels)} channels, too many.")
        if any(c.xSampling != 1 or c.ySampling != 1 for c in channels):
            raise FormatError(f"{path} has subsampled channels, which are not supported.")
        claimed += 4 * width * height * len(channels)
    size = path.stat().st_size
    if claimed > MAX_EXPANSION * size:
        raise FormatError(f"{path} has {size} bytes and claims pixels of {claimed} bytes.")


def _check_finite(path: Path, layers: Mapping[str, np.ndarray]) -> None:
    for name, pixels in layers.items():
        bad = int(np.count_nonzero(~np.isfinite(pixels)))
        if bad:
            raise FormatError(f"{path}: layer {name} has {bad} values that are not finite.")


def _part_pixels(path: Path, part: Any) -> np.ndarray:
    channels = {name.split(".")[-1].upper(): c.pixels for name, c in part.channels.items()}
    if not channels:
        raise FormatError(f"{path} has a part without channels.")
    colour = [c for c in "RGB" if c in channels]
    grey = [c for c in channels if c != "A"] or list(channels)
    wanted = [*colour, *(["A"] if "A" in channels else [])] if colour else grey[:1]
    if len(wanted) == 2:
        raise FormatError(
            f"{path} has the channels {' and '.join(wanted)}, neither grey nor colour."
        )
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
