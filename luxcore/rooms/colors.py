"""Colours of light: the Planckian locus in linear Rec.709, with a small variation in HSV."""

from __future__ import annotations

import colorsys

import numpy as np

from luxcore.rooms.dice import Rng
from luxcore.rooms.shapes import Vec3

TEMPERATURE_K = (2700.0, 6500.0)
"""Range of lamps: warm filament bulbs to daylight tubes."""

HSV_JITTER = 0.1
_LUMINANCE = (0.2126, 0.7152, 0.0722)
_REC709_FROM_XYZ = np.array(
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
)


def black_body(temperature_k: float) -> Vec3:
    """Linear Rec.709 colour of a black body, luminance 1, 1667..25000 K (Kim et al. 2002 fit)."""
    t = 1000.0 / temperature_k
    if temperature_k <= 4000:
        x = ((-0.2661239 * t - 0.2343589) * t + 0.8776956) * t + 0.179910
    else:
        x = ((-3.0258469 * t + 2.1070379) * t + 0.2226347) * t + 0.240390
    if temperature_k <= 2222:
        y = ((-1.1063814 * x - 1.34811020) * x + 2.18555832) * x - 0.20219683
    elif temperature_k <= 4000:
        y = ((-0.9549476 * x - 1.37418593) * x + 2.09137015) * x - 0.16748867
    else:
        y = ((3.0817580 * x - 5.87338670) * x + 3.75112997) * x - 0.37001483
    rgb = _REC709_FROM_XYZ @ np.array([x / y, 1.0, (1 - x - y) / y])
    return _unit_luminance(np.maximum(rgb, 0.0))


def jittered(rng: Rng, color: Vec3, amount: float = HSV_JITTER) -> Vec3:
    """Hue, saturation and value each moved by up to ±amount; luminance 1 again."""
    peak = max(color)
    h, s, v = colorsys.rgb_to_hsv(*(c / peak for c in color))
    dh, ds, dv = rng.uniform(-amount, amount, 3)
    # Hue is a circle: 10 % of a sixth of it keeps a white lamp from turning green.
    rgb = colorsys.hsv_to_rgb((h + dh / 6) % 1, min(1.0, max(0.0, s + ds)), v * (1 + dv))
    return _unit_luminance(np.array(rgb))


def _unit_luminance(rgb: np.ndarray) -> Vec3:
    r, g, b = (rgb / float(rgb @ np.array(_LUMINANCE))).round(5).tolist()
    return (r, g, b)
