"""Training photos: right light in the right pixels, and the same photo for the same number."""

import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from analytic import LAMPS, light_at, panorama, perspective

from luxcore.cameras import look_at
from luxcore.data.compact import as_taken
from luxcore.data.crops import LitCrop, ViewSource, with_lamps
from luxcore.data.lighting import (
    brackets,
    draw_relighting,
    exposed,
    one_light_off,
    one_more_burning,
)
from luxcore.data.multiview import MultiViewSets
from luxcore.data.panorama import view_rotation
from luxcore.data.training import SingleViewSamples, generator, mask_centre_deg
from luxcore.errors import InputError
from luxcore.files.digests import array_digest

SIZE = (24, 32)


def views():
    return [panorama(), panorama((4.0, 3.0, 1.4)), panorama((3.0, 1.2, 1.6), room="other")]


def world_points(crop: LitCrop) -> np.ndarray:
    camera = crop.camera
    v, u = np.mgrid[: camera.height, : camera.width] + 0.5
    local = np.stack(
        [(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], -1
    )
    return camera.centre + (local * crop.depth_m[..., None]) @ camera.c2w[:3, :3].T


def sample_digest(seed_and_index: tuple[int, int]) -> str:
    seed, index = seed_and_index
    sample = SingleViewSamples(views(), SIZE, seed)[index]
    return "".join(array_digest(np.asarray(sample[name])) for name in sorted(sample))


def test_crop_has_the_light_of_its_surfaces():
    source = ViewSource(panorama(height=256))
    crop = source.cut(view_rotation(40.0, -5.0), 60.0, 32, 24)
    points = world_points(crop)
    expected = light_at(points, np.round(crop.normal), 0) * source.view.scale[0]
    # Nearest depth and bilinear light differ by half a panorama pixel: 0.6 degrees.
    inner = np.abs(np.abs(crop.normal).max(-1) - 1) < 1e-3
    assert np.abs(crop.lights[0] - expected)[inner].max() < 0.03 * expected.max()
    assert inner.mean() > 0.8


def test_rotated_panorama_gives_the_same_world():
    turned = panorama(height=128)
    yaw = view_rotation(50.0, 0.0) @ view_rotation(0.0, 0.0).T
    c2w = turned.c2w.copy()
    c2w[:3, :3] = yaw
    crop = ViewSource(turned).cut(view_rotation(10.0, 0.0), 60.0, 32, 24)
    moved = ViewSource(replace(turned, c2w=c2w)).cut(view_rotation(10.0, 0.0), 60.0, 32, 24)
    assert np.allclose(moved.camera.c2w[:3, :3], yaw @ crop.camera.c2w[:3, :3])


def test_photo_is_the_sum_of_its_lights():
    sample = SingleViewSamples(views(), SIZE, seed=0)[3]
    total = sample["ambient"] + np.einsum("k,khwc->hwc", sample["on"] * 1.0, sample["lights"])
    assert np.allclose(sample["input_linear"], total, rtol=1e-6)


def test_target_lamp_is_first_and_in_sight():
    samples = SingleViewSamples(views(), SIZE, seed=5)
    seen = [samples[i] for i in range(len(samples))]
    assert all(s["masks"].shape[0] == s["lights"].shape[0] == s["on"].shape[0] for s in seen)
    assert np.mean([s["masks"].shape[0] > 0 and s["masks"][0].any() for s in seen]) > 0.95
    # The target is drawn anew for each photo, so different lamps come first.
    assert len({round(float(s["lights"][0].mean()), 4) for s in seen}) > 10


def test_same_number_same_photo_in_any_process():
    keys = [(0, 0), (0, 7), (1, 7), (0, 1000)]
    here = [sample_digest(key) for key in keys]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        there = list(pool.map(sample_digest, keys))
    assert here == there
    assert len(set(here)) == len(keys)


def test_order_of_asking_does_not_matter():
    forward, backward = (SingleViewSamples(views(), SIZE, seed=2) for _ in range(2))
    first = [forward[i]["input_linear"] for i in range(6)]
    second = [backward[i]["input_linear"] for i in reversed(range(6))][::-1]
    assert all((a == b).all() for a, b in zip(first, second, strict=True))


def test_lamps_out_of_sight_join_the_ambient():
    crop = ViewSource(panorama()).cut(view_rotation(0.0, 0.0), 70.0, 32, 24)
    kept = with_lamps(crop, [2])
    assert np.allclose(kept.image_linear, crop.image_linear, rtol=1e-5)
    assert np.allclose(kept.ambient, crop.ambient + crop.lights[0] + crop.lights[1], rtol=1e-6)


def test_one_light_off_is_the_photo_without_it():
    crop = ViewSource(panorama()).cut(view_rotation(0.0, 0.0), 70.0, 32, 24)
    assert np.allclose(one_light_off(crop, 0), crop.ambient + crop.lights[1], atol=1e-5)
    # Lamp 2 is off in the photo: there is nothing to take away.
    assert np.allclose(one_light_off(crop, 2), crop.image_linear)


def test_relighting_is_composition():
    crop = ViewSource(panorama()).cut(view_rotation(0.0, 0.0), 70.0, 32, 24)
    relighting = draw_relighting(generator(3), 3)
    moved = relighting.apply(crop)
    change = relighting.on[:, None] * relighting.gain - crop.on[:, None]
    composed = crop.image_linear + np.einsum("mc,mhwc->hwc", change, crop.lights)
    composed += (relighting.ambient_gain - 1) * crop.ambient
    assert np.allclose(moved.image_linear, composed, rtol=1e-4, atol=1e-6)


def test_brackets_darken():
    light = np.full((2, 2, 3), 2.0, np.float32)
    shown = brackets(light, 1.0)
    assert shown.shape == (3, 2, 2, 3)
    assert shown[0].min() > shown[1].max() > shown[2].max()


def test_without_lamps_there_is_still_a_photo():
    sample = SingleViewSamples([panorama(lamps=0)], SIZE, seed=0)[0]
    assert sample["masks"].shape == (0, *SIZE)
    assert np.allclose(sample["input_linear"], sample["ambient"])


def test_no_views_is_an_error():
    with pytest.raises(InputError, match="no rendered views"):
        SingleViewSamples([], SIZE, seed=0)


def test_centre_of_a_mask_across_the_seam():
    view = panorama((3.0, 1.0, 1.6), height=64)
    azimuth, elevation = mask_centre_deg(view.masks["emitter"][0])
    to_lamp = LAMPS[0] - [3.0, 1.0, 1.6]
    assert abs(abs(azimuth) - 180) < 3
    assert elevation == pytest.approx(np.degrees(np.arctan2(to_lamp[2], 2.0)), abs=3)


def test_perspective_view_is_resized_whole():
    camera = look_at(np.array([1.0, 3.0, 1.5]), np.array([5.0, 2.0, 1.2]), 70.0, 64, 48)
    view = perspective(camera)
    crop = ViewSource(view).whole(32, 24)
    assert crop.camera.fx == pytest.approx(camera.fx / 2)
    blocks = view.ambient.reshape(24, 2, 32, 2, 3).mean((1, 3))
    assert np.allclose(crop.ambient, blocks, atol=1e-5)
    square = ViewSource(view).whole(24, 24)
    assert square.camera.cx == pytest.approx(12)
    assert np.allclose(as_taken(view).mean(), crop.image_linear.mean(), rtol=1e-3)


def test_multiview_set_shares_lamps_light_and_exposure():
    sets = MultiViewSets(views(), SIZE, seed=0, views_per_set=5)
    stacked = sets[0]
    assert stacked["input_linear"].shape == (5, *SIZE, 3)
    assert len(np.unique(stacked["exposure"])) == 1
    assert (stacked["on"] == stacked["on"][0]).all()
    assert stacked["masks"][0, 0].any()


def test_multiview_photos_agree_on_a_surface():
    crops = MultiViewSets(views()[:2], (48, 64), seed=1, views_per_set=6).crops(0, 6)
    factors = np.array([[lamp_factor(crop, lamp) for lamp in range(3)] for crop in crops])
    # The target is one of the three lamps of the room: for it all photos find the same factor.
    spread = (factors.max(0) / factors.min(0) - 1).max(-1)
    assert np.nanmin(spread) < 0.03


def lamp_factor(crop: LitCrop, lamp: int) -> np.ndarray:
    """What the target's light was multiplied with, if it is the light of `lamp`. [3]"""
    normal = np.round(crop.normal)
    alone = light_at(world_points(crop), normal, lamp)
    flat = (np.abs(crop.normal - normal).max(-1) < 1e-3) & (alone.min(-1) > 0.02)
    if not flat.any():
        return np.full(3, np.nan)
    return np.median((crop.lights[0] / np.maximum(alone, 1e-3))[flat], axis=0)


def test_multiview_photos_overlap_and_do_not_stand_in_walls():
    sets = MultiViewSets(views()[:2], SIZE, seed=4, views_per_set=6)
    for index in range(3):
        for crop in sets.crops(index, 6)[1:]:
            assert np.median(crop.depth_m) > 0.7
    centres = {tuple(crop.camera.centre) for i in range(3) for crop in sets.crops(i, 6)}
    assert len(centres) == 2


def test_multiview_set_of_perspective_views_takes_each_once():
    cameras = [
        look_at(np.array([1.0 + i, 2.0, 1.5]), np.array([5.0, 3.0, 1.2]), 80.0, 32, 24)
        for i in range(3)
    ]
    crops = MultiViewSets([perspective(c) for c in cameras], SIZE, seed=0).crops(0, 8)
    assert len(crops) == 3
    assert len({tuple(c.camera.centre) for c in crops}) == 3


def test_a_camera_on_a_tripod_keeps_the_exposure_of_the_lamp_that_went_off():
    crop = ViewSource(panorama()).cut(view_rotation(0.0, 0.0), 70.0, 32, 24)
    dark = replace(crop, on=np.array([True, False, True]))
    lit = one_more_burning(dark.on, generator(1))
    assert lit.all()
    (kept,) = exposed([dark], generator(2), metered=lit)
    (chosen,) = exposed([replace(dark, on=lit)], generator(2))
    assert kept.exposure == chosen.exposure
    assert exposed([dark], generator(2))[0].exposure > kept.exposure
    assert (kept.on == dark.on).all()
    assert one_more_burning(lit, generator(1)).all()
