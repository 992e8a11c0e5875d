"""Numbers about one rendered view, from its files or from what was read of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from luxcore.data.compact import MASKS_FILE, RenderedView, read_metadata
from luxcore.errors import FormatError
from luxcore.files.exr import HALF_MAX, read_exr
from luxcore.files.json_numbers import finite, flag, three, whole

Seconds = Mapping[str, float]
"""CPU seconds by step of a render."""


@dataclass(frozen=True)
class LampFacts:
    """One lamp in one view. None: the files of the view do not say."""

    name: str
    kind: str
    design: str | None
    on: bool
    power_w: float
    color: tuple[float, float, float]
    temperature_k: float | None
    emitter_px: int
    fixture_px: int
    noise: float | None
    """Mean absolute residual of the denoiser over mean radiance."""
    energy_factor: float | None
    """What gave back the light that the denoiser took."""


@dataclass(frozen=True)
class ViewFacts:
    """One view of a room."""

    name: str
    room: str
    use: str | None
    size: tuple[int, int]
    """Rows and columns."""
    spp: int | None
    lamps: tuple[LampFacts, ...]
    ambient_noise: float | None
    window_px: int
    clipped_values: int
    """Values of light at the largest that half precision holds."""
    topped_up: str | None
    """The light that was rendered a second time."""
    effects: dict[str, Any]
    seconds: Seconds | None = None


def facts_of_files(stem: Path, name: str, seconds: Seconds | None = None) -> ViewFacts:
    """From the files of a view in the compact form. Raises InputError or FormatError."""
    about = read_metadata(stem)
    masks = read_exr(stem.with_name(stem.name + MASKS_FILE))
    areas = {kind: int((layer[..., 0] > 0.5).sum()) for kind, layer in masks.items()}
    layers = read_exr(stem.with_name(stem.name + ".exr"))
    light = [v for k, v in layers.items() if k.startswith(("ambient", "light_"))]
    try:
        size = masks["window"].shape[:2]
        return _facts(name, about, about["lamps"], areas, size, _clipped(light), seconds)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise FormatError(f"{stem}.json and its EXR files do not agree: {error}.") from error


def facts_of_view(view: RenderedView, name: str) -> ViewFacts:
    """From a view at hand, such as one of a public scene."""
    areas = {
        f"{kind}_{i:02d}": int(mask.sum())
        for kind, masks in view.masks.items()
        for i, mask in enumerate(masks)
    }
    areas["window"] = int(view.window.sum())
    known = view.metadata.get("lamps", [{}] * len(view.lamps))
    lamps = [{**old, **vars(lamp)} for old, lamp in zip(known, view.lamps, strict=True)]
    about = {**view.metadata, "room": view.room}
    clipped = _clipped([view.ambient, *view.lights])
    try:
        return _facts(name, about, lamps, areas, view.window.shape, clipped, None)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise FormatError(f"{name} has metadata that cannot be used: {error}.") from error


def _facts(
    name: str,
    about: Mapping[str, Any],
    lamps: list[dict[str, Any]],
    areas: Mapping[str, int],
    size: tuple[int, ...],
    clipped: int,
    seconds: Seconds | None,
) -> ViewFacts:
    # The public layout has its own place for the samples.
    samples = about.get("spp", (about.get("blender_cfg") or {}).get("spp"))
    return ViewFacts(
        name=name,
        room=str(about.get("room")),
        use=_word(about.get("use")),
        size=(int(size[0]), int(size[1])),
        spp=None if samples is None else whole(samples, "spp"),
        lamps=tuple(_lamp(about, lamp, i, areas) for i, lamp in enumerate(lamps)),
        ambient_noise=_number(about.get("noise", {}), "ambient"),
        window_px=areas["window"],
        clipped_values=clipped,
        topped_up=_word(about.get("topped_up")),
        effects={name: dict(effect) for name, effect in about.get("effects", {}).items()},
        seconds=seconds,
    )


def _lamp(
    about: Mapping[str, Any], lamp: Mapping[str, Any], index: int, areas: Mapping[str, int]
) -> LampFacts:
    key = f"{index:02d}"
    return LampFacts(
        name=str(lamp["name"]),
        kind=str(lamp["kind"]),
        design=_word(lamp.get("design")),
        on=flag(lamp["on"], "on"),
        power_w=finite(lamp["power_w"], "power_w"),
        color=three(lamp["color"], "color"),
        temperature_k=_number(lamp, "temperature_k") or None,
        emitter_px=areas[f"emitter_{key}"],
        fixture_px=areas[f"fixture_{key}"],
        noise=_number(about.get("noise", {}), f"light_{key}"),
        energy_factor=_number(about.get("energy_factors", {}), f"light_{key}"),
    )


def _clipped(light: Sequence[np.ndarray]) -> int:
    return sum(int(np.count_nonzero(np.abs(layer) >= HALF_MAX)) for layer in light)


def _number(values: Mapping[str, Any], name: str) -> float | None:
    value = values.get(name)
    return None if value is None else finite(value, name)


def _word(value: Any) -> str | None:
    return None if value is None else str(value)
