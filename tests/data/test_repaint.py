"""Other paint: the picture changes, the lamps' shares and the lamps themselves do not."""

from __future__ import annotations

import numpy as np
from numpy.random import PCG64, Generator

from luxcore.data.repaint import repainted
from tests.models.sketched import sketched_crops


def test_paint_keeps_every_lamps_share_and_the_lamps() -> None:
    (crop,) = sketched_crops(1)
    other = repainted(crop, Generator(PCG64(3)))
    before, after = (
        c.lights / np.maximum(c.ambient + c.lights.sum(0), 1e-6) for c in (crop, other)
    )
    np.testing.assert_allclose(after, before, rtol=1e-4, atol=1e-6)
    lamps = crop.masks.any(0)
    assert lamps.any()
    np.testing.assert_array_equal(other.lights[:, lamps], crop.lights[:, lamps])
    assert np.abs(np.log(other.image_linear / crop.image_linear))[~lamps].std() > 0.05


def test_paint_follows_from_the_generator_alone() -> None:
    (crop,) = sketched_crops(1)
    first, again, third = (repainted(crop, Generator(PCG64(s))) for s in (1, 1, 2))
    np.testing.assert_array_equal(first.ambient, again.ambient)
    assert not np.array_equal(first.ambient, third.ambient)
