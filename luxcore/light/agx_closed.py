"""AgX without a table: the formula whose values fill the published 57³ table.

Steps, as in AgX_LUT_Gen: lower guard rail in Rec.2020, inset, log2 and sigmoid per channel, 40 %
hue mix, outset, lower guard rail in Rec.709. Works on numpy and torch alike. At the nodes of the
published table it agrees with it to 2e-6.
"""

from __future__ import annotations

from types import ModuleType

import numpy as np

from luxcore.light import agx_constants as k
from luxcore.light.arrays import Array, colour_matrix, namespace

BISECTIONS = 40
"""Halvings of the log axis when the hue mix is undone; only a table's nodes pay for them."""


def formed_from_scene(linear: Array) -> Array:
    """Display-linear Rec.709 in 0..1, [..., 3], of scene-linear Rec.709 [..., 3]."""
    xp = namespace(linear)
    wide = colour_matrix(linear, k.REC2020_FROM_709)
    scene = colour_matrix(_guard_rail(xp, wide, k.CIE2015_LUMINANCE_2020, fade=False), k.INSET)
    formed = colour_matrix(_mix_hue(xp, scene, _curve(xp, scene)), k.OUTSET)
    narrow = colour_matrix(formed, k.REC709_FROM_2020)
    return xp.clip(_guard_rail(xp, narrow, k.CIE2015_LUMINANCE_709, fade=True), 0.0, 1.0)


def scene_from_formed(formed_709: Array) -> Array:
    """Inverse of `formed_from_scene` with both guard rails taken as idle."""
    xp = namespace(formed_709)
    formed = colour_matrix(colour_matrix(formed_709, k.REC2020_FROM_709), k.OUTSET_INVERSE)
    scene = _unmix_hue(xp, xp.clip(formed, 0.0, 1.0))
    return colour_matrix(colour_matrix(scene, k.INSET_INVERSE), k.REC709_FROM_2020)


def _guard_rail(xp: ModuleType, colours: Array, weights: np.ndarray, *, fade: bool) -> Array:
    """Lift a colour with negative channels to 0 and keep its compensated luminance.

    `fade` limits the compensation for opponent colours to dark ones, as the Rec.709 rail does.
    """
    lowest = xp.amin(colours, axis=-1, keepdims=True)
    lifted = colours - xp.clip(lowest, None, 0.0)
    before = _compensated_luminance(xp, colours, weights, fade)
    after = _compensated_luminance(xp, lifted, weights, fade)
    ratio = xp.clip(before / xp.clip(after, 1e-12, None), 0.0, 1.0)
    return xp.where(lowest < 0.0, ratio * lifted, colours)


def _compensated_luminance(
    xp: ModuleType, colours: Array, weights: np.ndarray, fade: bool
) -> Array:
    """Luminance that does not fall below zero where a colour's opponent is strong. [..., 1]"""
    luminance = colour_matrix(colours, weights[None])
    opponent = xp.amax(colours, axis=-1, keepdims=True) - colours
    missing = xp.amax(opponent, axis=-1, keepdims=True) - colour_matrix(opponent, weights[None])
    if not fade:
        return luminance + missing
    share = xp.clip(luminance, 1e-12, 1.0) ** k.COMPENSATION_POWER
    return luminance + (1.0 - share) * missing


def _curve(xp: ModuleType, scene: Array) -> Array:
    """Scene light to display-linear light, channel by channel: log2, sigmoid, power 2.4."""
    stops = xp.log2(xp.clip(scene, k.LINEAR_FLOOR, None) / k.MIDDLE_GREY)
    return _sigmoid(xp, (stops - k.MIN_EV) / (k.MAX_EV - k.MIN_EV)) ** k.DISPLAY_GAMMA


def _sigmoid(xp: ModuleType, x: Array) -> Array:
    """Rises from (0, 0) through the pivot to (1, 1) with a slope of 2.4 at the pivot."""
    scale = xp.where(x < k.PIVOT_X, xp.full_like(x, k.TOE_SCALE), k.SHOULDER_SCALE)
    term = k.SLOPE * (x - k.PIVOT_X) / scale
    rise = term / (1.0 + xp.clip(term, 0.0, None) ** k.POWER) ** (1.0 / k.POWER)
    # Rounding may leave the toe's end a hair below zero, where the power is not defined.
    return xp.clip(scale * rise + k.PIVOT_Y, 0.0, None)


def _sigmoid_inverse(xp: ModuleType, y: Array) -> Array:
    scale = xp.where(y < k.PIVOT_Y, xp.full_like(y, k.TOE_SCALE), k.SHOULDER_SCALE)
    rise = xp.clip((y - k.PIVOT_Y) / scale, 0.0, 1.0 - 1e-6)
    term = rise / (1.0 - rise**k.POWER) ** (1.0 / k.POWER)
    return xp.clip(term * scale / k.SLOPE + k.PIVOT_X, 0.0, 1.0)


def _mix_hue(xp: ModuleType, scene: Array, formed: Array) -> Array:
    """Hue: 60 % of the scene's, 40 % of the formed colour's; largest and smallest channel stay.

    The curve keeps the order of the channels, so the hues share a sextant and mixing HSV hues is
    the same as mixing how far each channel lies between the smallest and the largest.
    """
    low, span = _range(xp, scene)
    formed_low, formed_span = _range(xp, formed)
    grey = span <= 1e-6 * (low + span)
    position = (scene - low) / xp.where(grey, xp.ones_like(span), span)
    kept = formed_low + formed_span * position
    return xp.where(grey, formed, kept + k.HUE_MIX * (formed - kept))


def _unmix_hue(xp: ModuleType, formed: Array) -> Array:
    """Scene light whose formed and hue-mixed colour is `formed`, by bisection along the curve."""
    low, high = xp.zeros_like(formed), xp.ones_like(formed)
    extremes = _decode(_sigmoid_inverse(xp, formed ** (1.0 / k.DISPLAY_GAMMA)))
    scene_low, scene_span = _range(xp, extremes)
    formed_low, formed_span = _range(xp, formed)
    slope = formed_span / xp.where(scene_span > 0, scene_span, xp.ones_like(scene_span))
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        kept = formed_low + slope * (_decode(middle) - scene_low)
        mixed = kept + k.HUE_MIX * (_sigmoid(xp, middle) ** k.DISPLAY_GAMMA - kept)
        low = xp.where(mixed < formed, middle, low)
        high = xp.where(mixed < formed, high, middle)
    # The largest and the smallest channel need no search: the mix leaves them alone.
    found = _decode(0.5 * (low + high))
    ends = (formed <= formed_low) | (formed >= formed_low + formed_span)
    return xp.where(ends, extremes, found)


def _range(xp: ModuleType, colours: Array) -> tuple[Array, Array]:
    low = xp.amin(colours, axis=-1, keepdims=True)
    return low, xp.amax(colours, axis=-1, keepdims=True) - low


def _decode(x: Array) -> Array:
    """Scene light at position x in 0..1 of the logarithmic axis."""
    return k.MIDDLE_GREY * 2.0 ** (x * (k.MAX_EV - k.MIN_EV) + k.MIN_EV)
