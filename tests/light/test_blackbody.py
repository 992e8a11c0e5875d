"""Black bodies against tabulated chromaticities, at the ends of the range, and jittered."""

import numpy as np
import pytest

from luxcore.errors import InputError
from luxcore.light.blackbody import LUMINANCE_709, blackbody_rgb, jitter_hsv
from luxcore.light.exposure import KEY_LUMINANCE, estimate_exposure

XYZ_FROM_709 = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)


@pytest.mark.parametrize(
    ("kelvin", "x", "y"),
    [
        (2856.0, 0.4476, 0.4074),
        (4000.0, 0.3805, 0.3768),
        (6500.0, 0.3135, 0.3237),
        (10000.0, 0.2807, 0.2884),
    ],
)
def test_chromaticity_on_the_planckian_locus(kelvin, x, y):
    xyz = XYZ_FROM_709 @ blackbody_rgb(kelvin)
    # The analytic observer is good to about 0.004 in x and y.
    assert np.allclose(xyz[:2] / xyz.sum(), [x, y], atol=5e-3)


@pytest.mark.parametrize("kelvin", [800.0, 1000.0, 1900.0, 6500.0, 40000.0])
def test_ends_of_the_range_are_colours(kelvin):
    rgb = blackbody_rgb(kelvin)
    assert np.isfinite(rgb).all()
    assert (rgb >= 0).all()
    assert rgb @ LUMINANCE_709 == pytest.approx(1)


def test_hotter_is_bluer():
    ratios = [np.divide(*blackbody_rgb(k)[[2, 0]]) for k in np.geomspace(2000, 40000, 30)]
    assert (np.diff(ratios) > 0).all()


@pytest.mark.parametrize("kelvin", [799.0, 40001.0, float("nan")])
def test_outside_of_the_range(kelvin):
    with pytest.raises(InputError, match="800 to 40000"):
        blackbody_rgb(kelvin)


def test_jitter_is_small_and_keeps_black():
    rng = np.random.default_rng(0)
    white = np.ones(3)
    moved = np.array([jitter_hsv(white, rng) for _ in range(200)])
    assert np.ptp(moved.max(1)) > 0.1
    assert (np.abs(moved - 1) <= 0.21).all()
    assert (jitter_hsv(np.zeros(3), rng) == 0).all()


def test_exposure_puts_the_room_at_middle_grey_whatever_lamps_are_in_sight():
    room = np.full((40, 40, 3), 0.02, np.float32)
    room[:4, :10] = 500.0
    assert estimate_exposure(room) * 0.02 == pytest.approx(KEY_LUMINANCE, rel=1e-3)


def test_exposure_of_black_and_of_nan_is_finite():
    assert np.isfinite(estimate_exposure(np.zeros((4, 4, 3), np.float32)))
    assert np.isfinite(estimate_exposure(np.full((4, 4, 3), np.nan, np.float32)))
