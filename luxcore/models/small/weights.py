"""Weights on disk: safetensors in half precision, checked before anything is built from them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from luxcore.errors import FormatError, InputError
from luxcore.files.atomic import atomic_file
from luxcore.files.tensors import settle_header
from luxcore.models.small.features import MV_CHANNELS, SV_CHANNELS
from luxcore.models.small.geometry import GEOMETRY_OUTPUTS, PHOTO_CHANNELS
from luxcore.models.small.network import (
    MV_OUTPUTS,
    SV_OUTPUTS,
    LampNet,
    NetworkShape,
    UNet,
    channels_last,
)

FORMAT = "lux-small-1"
CHANNELS = {
    "sv": (SV_CHANNELS, SV_OUTPUTS),
    "mv": (MV_CHANNELS, MV_OUTPUTS),
    "geometry": (PHOTO_CHANNELS, GEOMETRY_OUTPUTS),
}
"""Inputs and outputs that this version builds and understands."""

SHIPPED = Path(__file__).parents[1] / "weights"
"""`geometry`, `sv` and `mv` `.safetensors`, trained by the recipe in docs/models.md."""

MAX_BYTES = 200_000_000
MAX_COUNT, MAX_DEPTH = 512, 16
"""Of channels, and of grids and middle blocks; far above any network that fits `MAX_BYTES`."""


def shipped_weights(kind: str) -> Path:
    """Where the project's own weights are."""
    return SHIPPED / f"{kind}.safetensors"


def shipped_network(kind: str) -> UNet | None:
    """The shipped network of a kind; None in a source tree that has none yet."""
    path = shipped_weights(kind)
    return load_network(path, kind) if path.is_file() else None


def save_weights(path: Path, kind: str, shape: NetworkShape, weights: Mapping[str, Tensor]) -> None:
    """Write `weights` of a network of `shape` as half precision. `kind`: of `CHANNELS`."""
    from safetensors.torch import save_file

    metadata = {"format": FORMAT, "kind": kind, "shape": json.dumps(shape.as_metadata())}
    tensors = {name: t.detach().half().contiguous() for name, t in weights.items()}
    with atomic_file(Path(path)) as temporary:
        save_file(tensors, str(temporary), metadata)
        settle_header(temporary)


def network_class(kind: str) -> type[UNet]:
    """The class of a kind: lamps are seen by a LampNet, a whole photo by a plain U-Net."""
    return UNet if kind == "geometry" else LampNet


def load_network(path: Path, kind: str) -> UNet:
    """The network of a weights file, ready to run.

    Raises InputError (missing) or FormatError: not safetensors (pickles are never opened), of
    another model, of another shape, or holding values that are not finite.
    """
    path = Path(path)
    metadata, tensors = _read(path)
    if metadata.get("format") != FORMAT or metadata.get("kind") != kind:
        raise FormatError(f"{path} holds no weights of the small {kind} model.")
    try:
        fields = json.loads(metadata["shape"])
        shape = NetworkShape(**{**fields, "widths": tuple(fields["widths"])})
        _check_shape(shape)
        net = network_class(kind)(shape)
    except (KeyError, TypeError, ValueError, RuntimeError, ZeroDivisionError) as error:
        raise FormatError(f"{path} describes no usable network: {error}.") from error
    if (shape.inputs, shape.outputs) != CHANNELS[kind]:
        raise FormatError(
            f"{path} has {shape.inputs} inputs and {shape.outputs} outputs, this version needs "
            f"{CHANNELS[kind][0]} and {CHANNELS[kind][1]}."
        )
    _check_tensors(path, tensors, net)
    net.load_state_dict({name: tensor.float() for name, tensor in tensors.items()})
    return channels_last(net).eval()


def _check_shape(shape: NetworkShape) -> None:
    """Raises ValueError before a network is built that no memory holds."""
    counts = [shape.inputs, shape.outputs, shape.unshuffle, shape.heads, shape.middle]
    counts += [shape.attending, shape.together, len(shape.widths), *shape.widths]
    deep = max(shape.middle, len(shape.widths)) > MAX_DEPTH
    if deep or max(counts) > MAX_COUNT or min(counts) < 0:
        raise ValueError(f"it is larger than any that fits {MAX_BYTES} bytes")


def _read(path: Path) -> tuple[dict[str, str], dict[str, Tensor]]:
    from safetensors import SafetensorError, safe_open

    if not path.is_file():
        raise InputError(f"{path} does not exist.")
    if path.stat().st_size > MAX_BYTES:
        raise FormatError(f"{path} is larger than {MAX_BYTES} bytes, too large for these weights.")
    try:
        with safe_open(path, "pt") as file:
            names: list[Any] = list(file.keys())
            return file.metadata() or {}, {name: file.get_tensor(name) for name in names}
    except (SafetensorError, OSError, ValueError) as error:
        raise FormatError(f"{path} is not a safetensors file: {error}.") from error


def _check_tensors(path: Path, tensors: Mapping[str, Tensor], net: UNet) -> None:
    expected = net.state_dict()
    strange = sorted(set(tensors) ^ set(expected))
    if strange:
        raise FormatError(f"{path} lacks or has too much of {strange[0]} ({len(strange)} in all).")
    for name, tensor in tensors.items():
        if tensor.shape != expected[name].shape:
            wanted = tuple(expected[name].shape)
            raise FormatError(f"{path}: {name} is {tuple(tensor.shape)}, expected {wanted}.")
        if not bool(torch.isfinite(tensor).all()):
            raise FormatError(f"{path}: {name} has values that are not finite.")
