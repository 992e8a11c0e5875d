"""The numbers of AgX, in one place: the Python, OpenCL and browser forms all take them from here.

Source: EaryChow's AgX (github.com/EaryChow/AgX, and AgX_LUT_Gen, which fills its table): the
transform "Linear Rec.709" → "AgX Base sRGB". Matrices act on column vectors.
"""

from __future__ import annotations

import numpy as np

MIDDLE_GREY = 0.18
MIN_EV, MAX_EV = -10.0, 6.5
"""The image is formed between these stops around middle grey."""

SLOPE = 2.4
POWER = 1.5
DISPLAY_GAMMA = 2.4
PIVOT_X = -MIN_EV / (MAX_EV - MIN_EV)
PIVOT_Y = MIDDLE_GREY ** (1.0 / DISPLAY_GAMMA)

HUE_MIX = 0.4
"""Share of the hue shift of the per-channel curve that is kept; the rest keeps the input's hue."""

LINEAR_FLOOR = MIDDLE_GREY * 2.0**MIN_EV
LINEAR_CEILING = MIDDLE_GREY * 2.0**MAX_EV

LATTICE_SIZE = 57
LATTICE_MIN_EV, LATTICE_MAX_EV = -10.0, 15.0
"""The published table: nodes per axis, and the stops around middle grey that an axis spans."""

CIE2015_LUMINANCE_2020 = np.array([0.2658180370250449, 0.59846986045365, 0.1357121025213052])
"""Weights of Rec.2020 channels in the guard rails' luminance (CIE 2015 observer)."""

COMPENSATION_POWER = 0.08
"""Exponent that fades the lower guard rail's correction for opponent colours out with luminance."""

_XYZ_FROM_2020 = np.array(
    [
        [0.6369535067850740, 0.1446191846692331, 0.1688558539228734],
        [0.2626983389565560, 0.6780087657728165, 0.0592928952706273],
        [0.0, 0.0280731358475570, 1.0608272349505707],
    ]
)
_709_FROM_XYZ = np.array(
    [
        [3.24100323297635872776, -1.53739896948878551619, -0.49861588199636291963],
        [-0.96922425220251640088, 1.87592998369517593993, 0.04155422634008471699],
        [0.05563941985197547180, -0.20401120612390993836, 1.05714897718753331191],
    ]
)
_XYZ_FROM_E = np.array(
    [
        [0.7053968501, 0.1640413283, 0.08101774865],
        [0.2801307241, 0.8202066415, -0.1003373656],
        [-0.1037815116, -0.07290725703, 1.265746519],
    ]
)
REC709_FROM_E = _709_FROM_XYZ @ _XYZ_FROM_E
E_FROM_709 = np.linalg.inv(REC709_FROM_E)
"""FilmLight's E-Gamut holds all of Rec.709; the table's axes are its channels."""

REC709_FROM_2020 = _709_FROM_XYZ @ _XYZ_FROM_2020
REC2020_FROM_709 = np.linalg.inv(REC709_FROM_2020)

INSET = np.array(
    [
        [0.856627153315983, 0.0951212405381588, 0.0482516061458583],
        [0.137318972929847, 0.761241990602591, 0.101439036467562],
        [0.11189821299995, 0.0767994186031903, 0.811302368396859],
    ]
)
INSET_INVERSE = np.linalg.inv(INSET)
OUTSET_INVERSE = np.array(
    [
        [0.899796955911611, 0.0871996192028351, 0.013003424885555],
        [0.11142098895748, 0.875575586156966, 0.0130034248855548],
        [0.11142098895748, 0.0871996192028349, 0.801379391839686],
    ]
)
OUTSET = np.linalg.inv(OUTSET_INVERSE)
CIE2015_LUMINANCE_709 = CIE2015_LUMINANCE_2020 @ REC2020_FROM_709
"""The same luminance, as weights of Rec.709 channels."""


def _scale(limit_x: float, limit_y: float) -> float:
    """Scale of the hyperbolic section that leaves the pivot with SLOPE and reaches (limit)."""
    rise = (SLOPE * limit_x / limit_y) ** POWER - 1.0
    return float(((SLOPE * limit_x) ** -POWER * rise) ** (-1.0 / POWER))


TOE_SCALE = -_scale(PIVOT_X, PIVOT_Y)
SHOULDER_SCALE = _scale(1.0 - PIVOT_X, 1.0 - PIVOT_Y)
