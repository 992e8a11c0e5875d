"""Write the Lighting Blend Explorer page of one photo."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from jaxtyping import Float

from luxcore.errors import InputError
from luxcore.explorer.codes import LOSSLESS, SLOPE, encode, fit_webp, span_of
from luxcore.explorer.levels import split_scale
from luxcore.files.atomic import atomic_file
from luxcore.light import agx_glsl
from luxcore.light.blackbody import blackbody_rgb

MAX_BYTES = 4_000_000
"""Size that a page should not exceed: it is sent by mail and opened on phones."""
MAX_SIDE = 1600
"""Longest side shown, in pixels; larger photos are averaged down in linear light."""
PAGE_BYTES = 40_000
"""Room kept for the page itself, without pictures."""
KELVINS = tuple(round(1500 * (12000 / 1500) ** (i / 24)) for i in range(25))
DAYLIGHT_K = 6500


def write_explorer(
    path: Path,
    photo_display: Float[np.ndarray, "h w 3"],
    ambient_linear: Float[np.ndarray, "ha wa 3"],
    olats_linear: Float[np.ndarray, "k ho wo 3"],
    scale: Float[np.ndarray, "ks 3"],
    names: Sequence[str],
    exposure: float,
) -> Path:
    """Write one HTML file that mixes `ambient + Σ scale·olat` in the browser, AgX-tone-mapped.

    photo_display: the photo as taken, sRGB-encoded 0..1. ambient_linear, olats_linear: Rec.709
    radiance, each lamp at unit white. scale: linear RGB of each lamp in the photo, 0 for a lamp
    that was off. exposure: factor g that brings radiance to the photo's exposure.
    Returns `path`. Raises InputError when the sizes disagree or values are not finite.
    """
    _check(path, photo_display, ambient_linear, olats_linear, scale, names, exposure)
    lamps = split_scale(scale)
    factor = _shrink_factor(photo_display.shape[:2])
    layers = [exposure * _shrink(ambient_linear, factor)]
    layers += [
        exposure * level * _shrink(olat, factor)
        for level, olat in zip(lamps.level, olats_linear, strict=True)
    ]
    spans = [span_of(layer) for layer in layers]
    codes = [encode(layer, span) for layer, span in zip(layers, spans, strict=True)]
    photo = np.round(np.clip(_shrink(photo_display, factor), 0, 1) * 255).astype(np.uint8)
    shown, files, quality = fit_webp(photo, codes, (MAX_BYTES - PAGE_BYTES) * 3 // 4)
    rows = [_row("Ambient light", True, np.ones(3), spans[0], files[0])]
    for name, lit, colour, span, file in zip(
        names, lamps.on, lamps.colour, spans[1:], files[1:], strict=True
    ):
        rows.append(_row(name, bool(lit), colour, span, file))
    scene = _scene(photo.shape, shown, rows, photo_display.shape, quality)
    with atomic_file(Path(path)) as temporary:
        temporary.write_text(_page(scene), encoding="utf-8")
    return Path(path)


def _row(name: str, on: bool, colour: np.ndarray, span: float, file: bytes) -> dict[str, Any]:
    return {
        "name": name,
        "on": on,
        "colour": [round(float(c), 5) for c in colour],
        "kelvin": _nearest_kelvin(colour),
        "span": span,
        "data": base64.b64encode(file).decode(),
    }


def _scene(
    shape: tuple[int, ...], photo: bytes, rows: list[dict], full: tuple[int, ...], quality: int
) -> dict[str, Any]:
    height, width = shape[:2]
    shown = f"{width} × {height} pixels"
    if full[:2] != shape[:2]:
        shown += f", averaged down from {full[1]} × {full[0]}"
    stored = "lossless WebP" if quality == LOSSLESS else f"WebP, quality {quality}"
    return {
        "width": width,
        "height": height,
        "photo": base64.b64encode(photo).decode(),
        "rows": rows,
        "temperatures": {
            "kelvins": KELVINS,
            "colours": [[round(float(c), 5) for c in _temperature_rgb(k)] for k in KELVINS],
        },
        "note": f"{shown}. Light is mixed in linear HDR and tone-mapped with AgX on this device; "
        f"layers are stored as 8-bit logarithmic codes ({stored}).",
    }


@cache
def _temperature_rgb(kelvin: int) -> np.ndarray:
    """Linear RGB of a black body, largest channel 1."""
    rgb = np.clip(np.asarray(blackbody_rgb(float(kelvin)), float), 0.0, None)
    return rgb / rgb.max()


def _nearest_kelvin(colour: np.ndarray) -> int:
    """Where the temperature slider rests for a colour; daylight for a neutral one."""
    if np.ptp(colour) < 1e-3:
        return DAYLIGHT_K
    return min(
        KELVINS, key=lambda k: float(np.abs(_temperature_rgb(k) - colour / colour.max()).sum())
    )


def _shrink_factor(size: tuple[int, ...]) -> float:
    return min(1.0, MAX_SIDE / max(size))


def _shrink(image: np.ndarray, factor: float) -> np.ndarray:
    if factor == 1.0:
        return image
    import cv2

    height, width = (max(1, round(side * factor)) for side in image.shape[:2])
    return cv2.resize(image.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)


def _page(scene: dict[str, Any]) -> str:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
        undefined=jinja2.StrictUndefined,
        autoescape=False,
    )
    fragment = environment.get_template("blend.frag").render(
        layers=len(scene["rows"]), slope=SLOPE, agx=agx_glsl.source()
    )
    # A lamp may be called "</script>": inside JSON "<" can always be written as an escape.
    text = json.dumps(scene, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")
    return environment.get_template("blend.html").render(
        scene=text, fragment=fragment, width=scene["width"], height=scene["height"]
    )


def _check(
    path: Path,
    photo: np.ndarray,
    ambient: np.ndarray,
    olats: np.ndarray,
    scale: np.ndarray,
    names: Sequence[str],
    exposure: float,
) -> None:
    if ambient.shape != photo.shape or olats.shape[1:] != photo.shape:
        raise InputError(
            f"{path}: photo {photo.shape}, ambient {ambient.shape} and lamps {olats.shape} "
            "must have one size."
        )
    if not len(scale) == len(names) == len(olats):
        raise InputError(
            f"{path}: {len(olats)} lamps, {len(scale)} scales and {len(names)} names must agree."
        )
    if not (np.isfinite(exposure) and exposure > 0):
        raise InputError(f"{path}: exposure must be a positive number, got {exposure}.")
    if not all(np.isfinite(values).all() for values in (photo, ambient, olats, scale)):
        raise InputError(f"{path}: the light of a layer is not finite.")
