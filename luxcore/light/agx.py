"""AgX: scene-linear light to a display image, and back.

The same image as EaryChow's OpenColorIO configuration, "Linear Rec.709" → "AgX Base sRGB", which
interpolates a 57³ table of a formula between nodes half a stop apart. On saturated colours that
interpolation moves the result by up to 15/255, so it belongs to the definition: here the nodes come
from the formula (`agx_closed`) and tetrahedra join them. One code serves numpy and torch (any float
precision; differentiable in torch). `agx_glsl` is the same for the browser.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import ModuleType

import numpy as np
import torch

from luxcore.light import agx_constants as k
from luxcore.light.agx_closed import formed_from_scene, scene_from_formed
from luxcore.light.arrays import Array, colour_matrix, namespace
from luxcore.light.lattice import Tetrahedra

CELLS = k.LATTICE_SIZE - 1
START_CELLS = 40
"""Cells per axis of the table that starts the inverse's search."""
NEWTON_STEPS = 12
BLOCK = 1 << 18
"""Colours of an array that are taken at once: some 100 MB, however large the photo."""


def agx(linear: Array) -> Array:
    """Display image [..., 3] in 0..1, sRGB-encoded, of linear Rec.709 radiance [..., 3].

    Negative (out-of-gamut) colours are brought inside; radiance up to 0.18·2^-10 is black, +inf is
    white, a colour with a NaN stays NaN. The gradient is zero where the image is clipped.
    """
    return _in_blocks(_shown, linear) if isinstance(linear, np.ndarray) else _shown(linear)


def agx_inverse(display: Array) -> Array:
    """Linear Rec.709 radiance [..., 3] that `agx` shows as `display` [..., 3] in 0..1.

    Black gives 0.18·2^-10 and white 0.18·2^6.5, the ends of the curve: what lies beyond them is
    lost. Where no radiance is shown so (clipped or saturated colours) the nearest found is
    returned, which may have a negative channel: saturated highlights of a photo that AgX did not
    make are such colours. A colour with a NaN gives NaN. Not differentiable.
    """
    if isinstance(display, torch.Tensor):
        # No gradient is due, and numpy gathers several times faster than torch on a CPU.
        found = torch.from_numpy(agx_inverse(display.detach().cpu().numpy()))
        return found.to(display.device)
    return _in_blocks(_inverted, display)


def _in_blocks(curve: Callable[[np.ndarray], np.ndarray], colours: np.ndarray) -> np.ndarray:
    """`curve` of all `colours` [..., 3], BLOCK of them at a time."""
    flat = colours.reshape(-1, 3)
    starts = range(0, max(len(flat), 1), BLOCK)
    found = np.concatenate([curve(flat[start : start + BLOCK]) for start in starts])
    return found.reshape(colours.shape)


def _shown(linear: Array) -> Array:
    """`agx` of colours [..., 3] at once."""
    xp = namespace(linear)
    position = _position(xp, linear)
    valid = xp.isfinite(position).all(-1)[..., None]
    encoded = Tetrahedra(xp.where(valid, position, xp.zeros_like(position)), lattice()).value()
    shown = srgb_encode(encoded**k.DISPLAY_GAMMA)
    return xp.where(valid, shown, xp.full_like(shown, float("nan")))


def _inverted(display: np.ndarray) -> np.ndarray:
    """`agx_inverse` of colours [n, 3] at once."""
    valid = np.isfinite(display).all(-1)[:, None]
    formed = srgb_decode(np.clip(np.where(valid, display, 0), 0, 1).astype(display.dtype))
    encoded = formed ** (1.0 / k.DISPLAY_GAMMA)
    position = _refine(Tetrahedra(encoded * START_CELLS, _start_lattice()).value(), encoded)
    scene = colour_matrix(_radiance(position / CELLS), k.REC709_FROM_E)
    return np.where(valid, scene, np.nan).astype(display.dtype)


def srgb_encode(linear: Array) -> Array:
    """IEC 61966-2-1 encoding of display-linear values in 0..1."""
    xp = namespace(linear)
    # The floor keeps the power's gradient finite in the branch that is not taken.
    power = 1.055 * xp.clip(linear, 0.0031308, None) ** (1.0 / 2.4) - 0.055
    return xp.where(linear <= 0.0031308, linear * 12.92, power)


def srgb_decode(display: Array) -> Array:
    """Display-linear values of sRGB-encoded ones in 0..1."""
    xp = namespace(display)
    power = ((xp.clip(display, 0.04045, None) + 0.055) / 1.055) ** 2.4
    return xp.where(display <= 0.04045, display / 12.92, power)


@cache
def lattice() -> np.ndarray:
    """[57³, 3] float64: encoded (power 1/2.4) colours at the nodes, red the slowest axis."""
    formed = formed_from_scene(colour_matrix(_radiance(_nodes(CELLS)), k.REC709_FROM_E))
    return formed ** (1.0 / k.DISPLAY_GAMMA)


@cache
def _start_lattice() -> np.ndarray:
    """[41³, 3] float64: for encoded colours, about where in `lattice` they come from."""
    formed = _nodes(START_CELLS) ** k.DISPLAY_GAMMA
    return _position(np, scene_from_formed(formed))


def _nodes(cells: int) -> np.ndarray:
    axis = np.arange(cells + 1) / cells
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)


def _position(xp: ModuleType, linear: Array) -> Array:
    """Where a colour lies in the lattice, in cells from the first node. NaN stays NaN."""
    ceiling = k.MIDDLE_GREY * 2.0**k.LATTICE_MAX_EV
    floor = k.MIDDLE_GREY * 2.0**k.LATTICE_MIN_EV
    bounded = xp.clip(linear, -ceiling, ceiling)
    wide = xp.clip(colour_matrix(bounded, k.E_FROM_709), floor, ceiling)
    stops = xp.log2(wide / k.MIDDLE_GREY) - k.LATTICE_MIN_EV
    return stops * (CELLS / (k.LATTICE_MAX_EV - k.LATTICE_MIN_EV))


def _radiance(position: Array) -> Array:
    """E-Gamut radiance at a position 0..1 of each lattice axis."""
    span = k.LATTICE_MAX_EV - k.LATTICE_MIN_EV
    return k.MIDDLE_GREY * 2.0 ** (position * span + k.LATTICE_MIN_EV)


def _refine(position: np.ndarray, encoded: np.ndarray) -> np.ndarray:
    """Newton's method on the piecewise linear map, on the pixels not yet right. [n, 3] each.

    A step may overshoot into a cell that fits worse before one that fits, so the best is kept.
    """
    tolerance = 32.0 * float(np.finfo(position.dtype).eps)
    result, here, target = position.copy(), position, encoded
    active, best = np.arange(len(position)), np.full(len(position), np.inf)
    for _ in range(NEWTON_STEPS):
        tetrahedra = Tetrahedra(here, lattice())
        residual = target - tetrahedra.value()
        error = np.abs(residual).max(-1)
        better = error < best
        result[active[better]] = here[better]
        moving = error > tolerance
        if not moving.any():
            break
        step = np.clip(tetrahedra.solve(residual), -1.0, 1.0)
        here = np.clip(here + step, 0.0, CELLS)[moving]
        active, target = active[moving], target[moving]
        best = np.where(better, error, best)[moving]
    return result
