"""Samples of rooms whose masks and lamps are at their limits."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from analytic import panorama

from luxcore.data.compact import RenderedView
from luxcore.data.multiview import MultiViewSets
from luxcore.data.public_reader import open_scenes
from luxcore.data.public_writer import write_scene
from luxcore.data.training import SingleViewSamples

SIZE = (16, 24)


def with_mask(mask: np.ndarray) -> RenderedView:
    """A room of one lamp whose three masks are `mask`."""
    view = panorama(height=32, lamps=1, on=(True,))
    return replace(view, masks={kind: mask[None] for kind in view.masks})


def one_pixel() -> np.ndarray:
    mask = np.zeros((32, 64), bool)
    mask[14, 20] = True
    return mask


def split() -> np.ndarray:
    """A lamp cut in two by what stands before it."""
    mask = np.zeros((32, 64), bool)
    mask[12:16, 18:20] = mask[12:16, 23:25] = True
    return mask


@pytest.mark.parametrize(
    ("mask", "seen"),
    [
        (np.zeros((32, 64), bool), 0),
        (np.ones((32, 64), bool), 1),
        (split(), 1),
    ],
    ids=["no pixel", "every pixel", "split"],
)
def test_masks_at_their_limits(mask, seen):
    samples = SingleViewSamples([with_mask(mask)], SIZE, seed=0)
    for i in range(4):
        sample = samples[i]
        assert len(sample["on"]) == seen
        assert np.isfinite(sample["input_linear"]).all()
        assert np.isfinite(sample["exposure"])


def test_a_lamp_of_one_pixel_is_sampled_or_joins_the_ambient():
    view = with_mask(one_pixel())
    as_taken = SingleViewSamples([view], SIZE, seed=0, relit=False)
    for i in range(6):
        sample = as_taken[i]
        light = sample["ambient"] + sample["lights"].sum(0)
        assert np.allclose(light, sample["input_linear"], rtol=1e-5)
        # Its light falls into the photo whether or not the lamp itself is found in it.
        assert light.mean() > 1.1 * view.ambient.mean()


def test_multiview_set_without_any_lamp_in_sight():
    stacked = MultiViewSets([with_mask(np.zeros((32, 64), bool))], SIZE, 0, views_per_set=3)[0]
    assert stacked["lights"].shape[:2] == (3, 0)


def test_a_lamp_of_no_watts_goes_round(tmp_path):
    view = panorama(height=16)
    dark = replace(view.lamps[0], power_w=0.0, scale=(0.0, 0.0, 0.0))
    view = replace(view, lamps=(dark, *view.lamps[1:]))
    assert np.isfinite(SingleViewSamples([view], SIZE, seed=0)[0]["input_linear"]).all()
    write_scene(tmp_path, "000000", [view])
    back = open_scenes(tmp_path)[0].read_view(1)
    assert np.isfinite(back.scale).all()
    assert (back.lights[0] == 0).all()


def test_two_lamps_in_one_place_stay_two(tmp_path):
    view = panorama(height=16, lamps=2, on=(True, True))
    twin = replace(view.lamps[0], name="twin")
    lights = np.stack([view.lights[0], view.lights[0]])
    masks = {kind: np.stack([m[0], m[0]]) for kind, m in view.masks.items()}
    view = replace(view, lamps=(view.lamps[0], twin), lights=lights, masks=masks)
    sample = SingleViewSamples([view], (48, 64), seed=0, relit=False)[0]
    assert len(sample["on"]) == 2
    write_scene(tmp_path, "000000", [view])
    back = open_scenes(tmp_path)[0].read_view(1)
    assert np.allclose(back.lights[0], back.lights[1])
