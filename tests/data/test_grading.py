"""Other contrast and white: the picture changes, the shares of what burns do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.random import PCG64, Generator

from luxcore.data.grading import graded
from tests.models.sketched import sketched_crops


def test_grading_keeps_the_share_of_every_lamp_that_burns() -> None:
    (crop,) = sketched_crops(1)
    other = graded(crop, Generator(PCG64(3)))
    before, after = (c.lights[c.on] / np.maximum(c.image_linear, 1e-6) for c in (crop, other))
    assert len(before)
    np.testing.assert_allclose(after, before, rtol=1e-4, atol=1e-6)
    assert np.abs(np.log(other.image_linear / crop.image_linear)).std() > 0.02


def test_light_of_a_lamp_that_is_off_is_graded_by_itself() -> None:
    (crop,) = sketched_crops(1)
    dark = replace(crop, on=np.zeros_like(crop.on))
    first, again = (graded(dark, Generator(PCG64(4))).lights for _ in range(2))
    np.testing.assert_array_equal(first, again)
    assert np.isfinite(first).all()
    # A curve about mid-grey keeps the order of light.
    order = np.argsort(dark.lights[0, ..., 0], axis=None, kind="stable")
    assert (np.diff(first[0, ..., 0].ravel()[order]) >= -1e-6).all()


def test_grading_follows_from_the_generator_alone() -> None:
    (crop,) = sketched_crops(1)
    first, third = (graded(crop, Generator(PCG64(s))) for s in (1, 2))
    assert not np.array_equal(first.ambient, third.ambient)
