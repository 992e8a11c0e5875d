"""Colours of hot bodies and small variations of them: what lamps look like."""

from __future__ import annotations

import colorsys

import numpy as np
from jaxtyping import Float
from numpy.random import Generator

from luxcore.errors import InputError

MIN_KELVIN, MAX_KELVIN = 800.0, 40_000.0
LUMINANCE_709 = np.array([0.2126, 0.7152, 0.0722])
"""Weights of linear Rec.709 channels in luminance (ITU-R BT.709; CIE 1931 observer)."""

HSV_JITTER = 0.1

_SECOND_RADIATION_M_K = 1.438776877e-2
_WAVELENGTHS_NM = np.arange(380.0, 781.0, 5.0)
_709_FROM_XYZ = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.969266, 1.8760108, 0.041556],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)
# (weight, centre nm, width below, width above) of the lobes of the CIE 1931 observer, after
# Wyman, Sloan, Shirley: Simple Analytic Approximations to the CIE XYZ Colour Matching Functions.
_LOBES = (
    ((1.056, 599.8, 37.9, 31.0), (0.362, 442.0, 16.0, 26.7), (-0.065, 501.1, 20.4, 26.2)),
    ((0.821, 568.8, 46.9, 40.5), (0.286, 530.9, 16.3, 31.1)),
    ((1.217, 437.0, 11.8, 36.0), (0.681, 459.0, 26.0, 13.8)),
)


def blackbody_rgb(kelvin: float) -> Float[np.ndarray, " 3"]:
    """Linear Rec.709 colour of a black body with luminance 1; 800..40,000 kelvin.

    Planck's spectrum seen by the CIE 1931 observer. Below about 1900 K the colour lies outside of
    Rec.709: blue is then 0. Raises InputError outside the range.
    """
    if not MIN_KELVIN <= kelvin <= MAX_KELVIN:
        raise InputError(f"colour temperature must be 800 to 40000 kelvin, got {kelvin}.")
    metres = _WAVELENGTHS_NM * 1e-9
    # Relative to the peak, since at 800 K the visible part of the spectrum is 1e-9 of it.
    exponent = _SECOND_RADIATION_M_K / (metres * kelvin)
    log_spectrum = -5.0 * np.log(metres) - np.log(np.expm1(exponent))
    spectrum = np.exp(log_spectrum - log_spectrum.max())
    rgb = np.maximum(_709_FROM_XYZ @ (_observer() @ spectrum), 0.0)
    return rgb / (LUMINANCE_709 @ rgb)


def jitter_hsv(
    rgb: Float[np.ndarray, " 3"], rng: Generator, amount: float = HSV_JITTER
) -> Float[np.ndarray, " 3"]:
    """A colour with hue, saturation and value moved by up to ±amount (paper, section 3.1).

    Hue moves by that share of a sixth of the circle, so that a white lamp does not turn green.
    """
    peak = float(np.max(rgb))
    if peak <= 0:
        return np.zeros(3)
    hue, saturation, value = colorsys.rgb_to_hsv(*(np.asarray(rgb) / peak))
    dh, ds, dv = rng.uniform(-amount, amount, 3)
    moved = colorsys.hsv_to_rgb((hue + dh / 6) % 1, min(1.0, max(0.0, saturation + ds)), value)
    return np.array(moved) * peak * (1 + dv)


def _observer() -> Float[np.ndarray, "3 n"]:
    rows = []
    for lobes in _LOBES:
        row = np.zeros_like(_WAVELENGTHS_NM)
        for weight, centre, below, above in lobes:
            width = np.where(centre > _WAVELENGTHS_NM, below, above)
            row += weight * np.exp(-0.5 * ((_WAVELENGTHS_NM - centre) / width) ** 2)
        rows.append(row)
    return np.stack(rows)
