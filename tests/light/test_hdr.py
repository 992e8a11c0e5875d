"""Merging brackets: accuracy over the range, and every case that the naive average gets wrong."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from luxcore.errors import InputError
from luxcore.light.agx import agx
from luxcore.light.agx_constants import LINEAR_CEILING, LINEAR_FLOOR
from luxcore.light.hdr import merge_brackets
from luxcore.light.response import CurveResponse

EVS = [0.0, -2.0, -4.0]


def patch(level: float, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return (level * rng.uniform(0.4, 1.0, (24, 24, 3))).astype(np.float32)


def eight_bit(linear: np.ndarray, evs=EVS, exposure: float = 1.0) -> list[np.ndarray]:
    shown = [agx(linear * np.float32(exposure * 2.0**ev)) for ev in evs]
    return [np.round(s * 255) / 255 for s in shown]


@pytest.mark.parametrize(
    ("level", "tolerance"), [(0.01, 0.03), (0.1, 0.01), (1.0, 0.01), (10.0, 0.01), (200.0, 0.04)]
)
def test_recovers_radiance_over_the_range(level, tolerance):
    truth = patch(level)
    merged = merge_brackets(eight_bit(truth), EVS)
    assert np.median(np.abs(merged.radiance / truth - 1)) < tolerance
    assert merged.clipped == merged.unknown == merged.disagreeing == 0


def test_one_bracket_alone_loses_what_the_set_keeps():
    truth = patch(60.0)
    alone = merge_brackets(eight_bit(truth)[:1], EVS[:1])
    assert alone.clipped > 0.5 * truth[..., 0].size
    together = merge_brackets(eight_bit(truth), EVS).radiance
    assert np.abs(together / truth - 1).max() < 0.1


def test_exposure_is_taken_out():
    truth = patch(1.0)
    merged = merge_brackets(eight_bit(truth, exposure=0.25), EVS, exposure=0.25)
    assert np.median(np.abs(merged.radiance / truth - 1)) < 0.01


def test_white_in_all_is_the_darkest_brackets_bound():
    merged = merge_brackets([np.ones((2, 2, 3))] * 3, EVS)
    assert merged.clipped == 4
    assert np.allclose(merged.radiance, LINEAR_CEILING * 16, rtol=0.02)


def test_black_in_all_is_capped_by_the_photo():
    black = [np.zeros((2, 2, 3))] * 3
    merged = merge_brackets(black, EVS)
    assert merged.black == 4
    assert np.allclose(merged.radiance, LINEAR_FLOOR, rtol=0.01)
    capped = merge_brackets(black, EVS, cap_linear=np.full((2, 2, 3), 1e-5))
    assert np.allclose(capped.radiance, 1e-5)


def test_nan_in_one_bracket_leaves_the_others():
    truth = patch(1.0)
    images = eight_bit(truth)
    images[1][:4, :4] = np.nan
    images[0][0, 0] = np.inf
    merged = merge_brackets(images, EVS)
    assert np.isfinite(merged.radiance).all()
    assert np.abs(merged.radiance / truth - 1).max() < 0.05


def test_nan_in_all_is_counted():
    merged = merge_brackets([np.full((2, 3, 3), np.nan)] * 3, EVS)
    assert merged.unknown == 6
    assert (merged.radiance == 0).all()


@pytest.mark.parametrize("gap_ev", [10.0, 12.0])
def test_light_between_exposures_far_apart_is_bounded_and_counted(gap_ev):
    """White in the long exposure, black in the short one: no bracket says how bright it is."""
    linear = CurveResponse(np.repeat((np.arange(256) / 255.0)[:, None], 3, 1))
    truth = np.geomspace(1e-2, 1e3, 200)[None, :, None].repeat(3, 2)
    evs = [0.0, -gap_ev]
    images = [np.round((truth * 2.0**ev).clip(0, 1) * 255) / 255 for ev in evs]
    merged = merge_brackets(images, evs, linear)
    # The bounds: white begins at 1, and the short exposure is black up to half a step of 255.
    ceiling = 2.0**gap_ev * 0.5 / 255
    between = ((truth >= 1) & (truth < ceiling)).all(-1)
    assert merged.gaps == between.sum() > 0
    assert merged.clipped + merged.black + merged.unknown == (truth < 0.5 / 255).all(-1).sum()
    assert np.allclose(merged.radiance[between], np.sqrt(ceiling), rtol=0.01)


def test_a_gap_in_saturated_agx_is_never_nan():
    """AgX's inverse of a white that no light gives has negative channels."""
    white = np.zeros((1, 2, 3))
    white[..., 0] = 1.0
    merged = merge_brackets([white, np.zeros((1, 2, 3))], [0.0, -12.0])
    assert merged.gaps == 2
    assert np.isfinite(merged.radiance).all()
    assert (merged.radiance[..., 0] > 0).all()


def test_no_gap_between_exposures():
    truth = patch(1.0)
    images = eight_bit(truth, [0.0, 0.0])
    assert np.median(np.abs(merge_brackets(images, [0.0, 0.0]).radiance / truth - 1)) < 0.01


def test_disagreement_is_counted_and_averaged():
    bright, dark = agx(patch(2.0)), agx(patch(0.5, seed=0))
    merged = merge_brackets([bright, dark], [0.0, 0.0])
    assert merged.disagreeing > 0
    assert (merged.radiance < patch(2.0)).mean() > 0.95


def test_order_of_brackets_does_not_matter():
    images = eight_bit(patch(30.0))
    forward = merge_brackets(images, EVS).radiance
    assert np.allclose(merge_brackets(images[::-1], EVS[::-1]).radiance, forward, rtol=1e-6)


def test_a_saturated_lamp_keeps_its_bright_channel():
    red = np.zeros((4, 4, 3), np.float32)
    red[..., 0] = 3.0
    merged = merge_brackets(eight_bit(red), EVS)
    # A weight that asks for all three channels inside the range would be 0 everywhere.
    assert np.allclose(merged.radiance[..., 0], 3.0, rtol=0.1)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.02, 200.0), st.integers(0, 1000))
def test_never_off_by_a_tenth_in_the_middle(level, seed):
    truth = patch(level, seed)
    radiance = merge_brackets(eight_bit(truth), EVS).radiance
    assert np.median(np.abs(radiance / truth - 1)) < 0.1


def test_a_cameras_own_curve():
    curve = np.repeat(((np.arange(256) / 255.0) ** 2.2)[:, None], 3, 1)
    truth = patch(0.8)
    images = [np.round((truth * 2.0**ev).clip(0, 1) ** (1 / 2.2) * 255) / 255 for ev in (0, -2)]
    merged = merge_brackets(images, [0.0, -2.0], CurveResponse(curve))
    assert np.median(np.abs(merged.radiance / truth - 1)) < 0.01


@pytest.mark.parametrize(
    ("images", "evs", "fact"),
    [
        ([], [], "no brackets"),
        ([np.zeros((2, 2, 3))], [0.0, 1.0], "1 brackets came with 2"),
        ([np.zeros((2, 2, 3)), np.zeros((3, 2, 3))], [0.0, 1.0], "one size"),
        ([np.zeros((2, 2, 3))], [float("nan")], "finite"),
    ],
)
def test_bad_brackets_are_one_sentence(images, evs, fact):
    with pytest.raises(InputError, match=fact):
        merge_brackets(images, evs)
