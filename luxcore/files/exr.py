"""OpenEXR: one named part per layer, read and written as float arrays, hostile headers refused."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from luxcore.errors import FormatError, InputError, LuxError
from luxcore.files.atomic import atomic_file
from luxcore.files.input import check_input_file
from luxcore.files.quiet import quiet

MAX_SIDE = 32_768
"""Largest width or height, in pixels, that a header may claim before anything is allocated."""

MAX_PARTS, MAX_CHANNELS = 256, 64
MAX_EXPANSION = 1_100
"""Most bytes of pixels per byte of file: zlib, the tightest of the codecs, cannot pass 1,032."""

HALF_MAX = 65_504.0
_HALF_ZERO = 2.0**-25
"""Half precision rounds this and everything smaller to 0."""
_RGB = {1: "Y", 3: "RGB", 4: "RGBA"}
_BEAUTY = "Combined"
_COMPOSITE = "Composite.Combined"
"""What Blender's compositor made of the beauty passes of all view layers."""

Channels = dict[str, np.ndarray]
"""Planes [H, W] of one layer by their letters in capitals."""


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
    Raises InputError when a layer is empty, not finite, or of a different size than the others,
    LuxError when the disk takes no more.
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
        try:
            exr.File(parts).write(str(temporary))
        except RuntimeError as error:
            fact = str(error).replace(str(temporary), str(path)).rstrip(".")
            raise LuxError(f"{path} cannot be written: {fact}.") from error
    return clipped


def read_exr(path: Path, *, finite: bool = True) -> dict[str, np.ndarray]:
    """Layers by part name, each [H, W, C] float32, C in 1, 3, 4 (channels R, G, B, A or Y first).

    A single unnamed part is called "image"; what is read is the data window, wherever it lies in
    the display window. Of several layers in one part the picture is taken, see `read_exr_image`.
    With `finite`, NaN and infinity are damage. Raises InputError (missing) or FormatError, naming
    the file and the fact, before memory is taken for what a header claims.
    """
    path = Path(path)
    layers = {
        (part.name() or "image"): _pixels(path, _picture(path, _layers(part))[1])
        for part in _parts(path)
    }
    if finite:
        _check_finite(path, layers)
    return layers


def read_exr_image(path: Path, *, finite: bool = True) -> np.ndarray:
    """The picture in an EXR as [H, W, 3] float32 linear radiance.

    Of several layers, in one part or in many, it is the unnamed one, else Combined (Blender's
    beauty pass, as in ViewLayer.Combined.R), else the only one in colour. Raises as `read_exr`
    does, and FormatError where that leaves a choice or a layer such as depth, which is no picture.
    """
    path = Path(path)
    name, channels = _picture(path, _named_layers(_parts(path)))
    if not (_is_colour(channels) or _is_grey(channels)):
        raise _neither(path, list(channels))
    pixels = _pixels(path, channels)
    if finite:
        _check_finite(path, {name or "image": pixels})
    return np.repeat(pixels, 3, axis=2) if pixels.shape[2] == 1 else pixels[..., :3]


def _parts(path: Path) -> list[Any]:
    """All parts with their pixels. Raises InputError or FormatError."""
    check_input_file(path)
    try:
        with quiet():
            declared = _check_header(path)
            parts = list(_library().File(str(path), separate_channels=True).parts)
    except (RuntimeError, ValueError, IndexError, MemoryError, UnicodeDecodeError) as error:
        fact = " ".join(str(error).split())
        raise FormatError(f"{path} is not a readable OpenEXR image: {fact}.") from error
    # The library leaves out what it cannot read.
    if not parts or len(parts) != declared:
        raise FormatError(
            f"{path} is truncated or damaged: {len(parts)} of its {declared} parts can be read."
        )
    if len({part.name() for part in parts}) != len(parts):
        raise FormatError(f"{path} holds two parts of the same name.")
    return parts


def _check_header(path: Path) -> int:
    """How many parts it declares. Raises FormatError for what it alone shows to be hostile."""
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
    return len(headers)


def _check_finite(path: Path, layers: Mapping[str, np.ndarray]) -> None:
    for name, pixels in layers.items():
        bad = int(np.count_nonzero(~np.isfinite(pixels)))
        if bad:
            raise FormatError(f"{path}: layer {name} has {bad} values that are not finite.")


def _named_layers(parts: Sequence[Any]) -> dict[str, Channels]:
    """The layers of all parts; the name of a part counts only beside others."""
    found = {}
    for part in parts:
        owner = part.name() if len(parts) > 1 else ""
        for name, channels in _layers(part).items():
            # Blender repeats a part's name in its channels.
            found[name if name.startswith(owner) else f"{owner}.{name}".rstrip(".")] = channels
    return found


def _layers(part: Any) -> dict[str, Channels]:
    """Channels by what stands before their last dot: "ViewLayer.Combined.R" is R of Combined."""
    layers: dict[str, Channels] = {}
    for full_name, channel in part.channels.items():
        name, _, letter = full_name.rpartition(".")
        layers.setdefault(name, {})[letter.upper()] = channel.pixels
    return layers


def _picture(path: Path, layers: Mapping[str, Channels]) -> tuple[str, Channels]:
    """The layer that is the picture, with its name; see `read_exr_image`. Raises FormatError."""
    if not layers:
        raise FormatError(f"{path} has a part without channels.")
    colour = [name for name, channels in layers.items() if _is_colour(channels)]
    choice = colour or list(layers)
    for wanted in ("", _BEAUTY):
        named = [name for name in choice if name.rpartition(".")[2] == wanted]
        if _COMPOSITE in named:
            named = [_COMPOSITE]
        if len(named) == 1:
            return named[0], layers[named[0]]
    if len(choice) != 1:
        raise FormatError(f"{path} holds several layers, {_listed(choice)}; give a file of one.")
    return choice[0], layers[choice[0]]


def _pixels(path: Path, channels: Channels) -> np.ndarray:
    """[H, W, 1|3|4] float32 of one layer. Raises FormatError."""
    others = [c for c in channels if c != "A"] or list(channels)
    if _is_colour(channels):
        wanted = [c for c in "RGBA" if c in channels]
    elif _is_grey(channels):
        wanted = ["Y"]
    elif len(others) == 1:
        wanted = others
    else:
        raise _neither(path, others)
    planes = [np.asarray(channels[c], np.float32) for c in wanted]
    if len({p.shape for p in planes}) != 1 or planes[0].ndim != 2 or 0 in planes[0].shape:
        raise FormatError(f"{path} has channels of different or unusable sizes.")
    return np.stack(planes, axis=-1)


def _is_colour(channels: Channels) -> bool:
    return channels.keys() >= set("RGB")


def _is_grey(channels: Channels) -> bool:
    # Y beside X is a direction, not luminance.
    return "Y" in channels and "X" not in channels


def _neither(path: Path, channels: Sequence[str]) -> FormatError:
    noun = "channel" if len(channels) == 1 else "channels"
    return FormatError(f"{path} has the {noun} {_listed(channels)}, neither grey nor colour.")


def _listed(names: Sequence[str]) -> str:
    *most, last = (name or "(unnamed)" for name in names)
    return f"{', '.join(most)} and {last}" if most else last


def _check_layer(path: Path, name: str, pixels: np.ndarray, size: tuple | None) -> None:
    if pixels.ndim != 3 or pixels.shape[2] not in _RGB or pixels.size == 0:
        raise InputError(
            f"{path}: layer {name} must be [H, W] or [H, W, 1|3|4], got {pixels.shape}."
        )
    if size is not None and pixels.shape[:2] != size:
        raise InputError(f"{path}: layer {name} is {pixels.shape[:2]}, the others are {size}.")
    if not np.isfinite(pixels).all():
        raise InputError(f"{path}: layer {name} has values that are not finite.")
