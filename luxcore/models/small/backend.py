"""How `luxcore.models.backends` opens the small models."""

from __future__ import annotations

from pathlib import Path

from luxcore.errors import InputError
from luxcore.models.interface import BackendSettings, Decomposer, Harmonizer
from luxcore.models.small.multi_view import SmallHarmonizer
from luxcore.models.small.single_view import SmallDecomposer
from luxcore.models.small.weights import load_network, shipped_network, shipped_weights

LONG_SIDE_PX = 64
"""Long side of the network's grid, as in training. At 96 and 128 px photos alone score 0.7 and 1.3
dB less, photos with given geometry the same within 0.2 (docs/tradeoff/README.md)."""

LONG_SIDE_RANGE = (32, 1024)


def open_decomposer(settings: BackendSettings) -> Decomposer:
    """`sv_weights` is a safetensors file (default: the shipped one); options `long_side_px` and
    `estimate` (false leaves the geometry of a lone photo unknown: an ablation)."""
    net = load_network(_path(settings.sv_weights, "sv"), "sv")
    estimator = shipped_network("geometry") if _switch(settings, "estimate") else None
    return SmallDecomposer(net, _long_side(settings), estimator)


def open_harmonizer(settings: BackendSettings) -> Harmonizer:
    """`mv_weights` is a safetensors file (default: the shipped one); options `long_side_px` and
    `warp` (false withholds the references' warped light: an ablation)."""
    net = load_network(_path(settings.mv_weights, "mv"), "mv")
    return SmallHarmonizer(net, _long_side(settings), _switch(settings, "warp"))


def _path(weights: str | None, kind: str) -> Path:
    path = shipped_weights(kind) if weights is None else Path(weights)
    return path / "model.safetensors" if path.is_dir() else path


def _switch(settings: BackendSettings, name: str) -> bool:
    value = settings.options.get(name, True)
    if not isinstance(value, bool):
        raise InputError(f"{name} must be true or false, got {value}.")
    return value


def _long_side(settings: BackendSettings) -> int:
    unknown = sorted(set(settings.options) - {"long_side_px", "warp", "estimate"})
    if unknown:
        raise InputError(
            f"the small backend has no option {unknown[0]}; it has long_side_px, warp and estimate."
        )
    value = settings.options.get("long_side_px", LONG_SIDE_PX)
    low, high = LONG_SIDE_RANGE
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        raise InputError(f"long_side_px must be a whole number from {low} to {high}, got {value}.")
    return value
