"""Masks from object indices: growth, hulls, the seam of a panorama."""

from __future__ import annotations

import numpy as np
import pytest

from luxcore.render.masks import MIN_EMITTER_PIXELS, convex_hull, grown, lamp_masks


def _blob(height: int, width: int, *pixels: tuple[int, int]) -> np.ndarray:
    mask = np.zeros((height, width), bool)
    for row, column in pixels:
        mask[row, column] = True
    return mask


def test_codes_become_masks_of_each_lamp() -> None:
    index = np.zeros((20, 40), np.float32)
    index[2:10, 4:10] = 12.0
    index[10:14, 4:10] = 13.0
    index[5:12, 20:30] = 23.0
    masks = lamp_masks(index, 2, fixture_code=2, emitter_code=3, wraps=False)
    assert masks["emitter_00"].sum() == 24
    assert masks["fixture_00"].sum() == 48 + 24
    assert masks["fixture_01"].sum() == masks["emitter_01"].sum() == 70
    assert not (masks["fixture_00"] & masks["fixture_01"]).any()


def test_small_emitters_grow_and_absent_ones_stay_absent() -> None:
    one = _blob(30, 60, (15, 30))
    assert grown(one, MIN_EMITTER_PIXELS, wraps=False).sum() == 25
    assert not grown(np.zeros((30, 60), bool), MIN_EMITTER_PIXELS, wraps=False).any()


def test_growth_crosses_the_seam_of_a_panorama_only() -> None:
    edge = _blob(30, 60, (15, 0))
    assert grown(edge, 9, wraps=True)[15, 59]
    assert not grown(edge, 9, wraps=False)[:, 40:].any()


def test_hull_of_a_triangle_is_filled() -> None:
    corners = _blob(40, 40, (5, 5), (5, 25), (25, 5))
    hull = convex_hull(corners, wraps=False)
    # Pixel centres on or inside a right triangle with legs of 20 pixels.
    assert hull.sum() == 21 * 22 // 2
    assert hull[10, 10]
    assert not hull[20, 20]


def test_hull_contains_the_mask_and_is_its_own_hull() -> None:
    rng = np.random.Generator(np.random.PCG64(3))
    for _ in range(10):
        mask = rng.random((24, 36)) < 0.02
        mask[4, 7] = True
        hull = convex_hull(mask, wraps=False)
        assert (hull | ~mask).all()
        assert (convex_hull(hull, wraps=False) == hull).all()


def test_hull_across_the_seam_does_not_fill_the_panorama() -> None:
    mask = _blob(20, 80, (8, 77), (8, 2), (12, 79))
    hull = convex_hull(mask, wraps=True)
    assert hull[8, 0]
    assert hull[8, 78]
    assert not hull[:, 10:70].any()
    assert hull.sum() == np.roll(convex_hull(np.roll(mask, 40, axis=1), wraps=False), 0).sum()


@pytest.mark.parametrize("pixels", [((3, 4),), ((3, 4), (3, 9)), ((2, 2), (6, 6))])
def test_hull_of_a_point_or_a_line(pixels: tuple[tuple[int, int], ...]) -> None:
    hull = convex_hull(_blob(12, 12, *pixels), wraps=False)
    rows, columns = zip(*pixels, strict=True)
    length = max(max(rows) - min(rows), max(columns) - min(columns)) + 1
    assert hull.sum() == length
    assert all(hull[pixel] for pixel in pixels)
