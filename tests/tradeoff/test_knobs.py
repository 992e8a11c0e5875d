"""The parts of knobs that compute something of their own."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from luxcore.rooms.batch import demo_room
from luxcore.settings.rooms import RoomsSettings
from luxcore.tradeoff.knobs import sampler, tiles
from luxcore.tradeoff.knobs.render import _only


@pytest.mark.parametrize(("length", "count"), [(240, 1), (240, 2), (320, 3), (97, 4)])
def test_tiles_cover_the_photo_and_their_weights_never_vanish(length: int, count: int) -> None:
    total = np.zeros(length)
    spans = list(tiles._spans(length, count))
    for span in spans:
        total[span] += tiles._ramp(span)
    assert len(spans) == count
    assert (total > 0).all()


def test_a_room_of_one_lamp_keeps_everything_but_the_other_light() -> None:
    room = demo_room(RoomsSettings())
    alone = _only(room, 1)
    assert {p.lamp for p in alone.parts if p.emits > 0} <= {1}
    assert {s.lamp for s in alone.spots} <= {1}
    assert alone.environment is None
    assert len(alone.parts) == len(room.parts)
    assert _only(room, None).environment == room.environment


def test_the_exact_velocity_of_one_gaussian_leads_to_it() -> None:
    """A single square: the posterior mean and so the velocity are those of a Gaussian."""
    square = torch.full((1, 3), 0.5)
    x, sigma = torch.tensor([[0.2, -0.4, 1.0]]), 0.6
    alpha, width = 1 - sigma, sampler.WIDTH
    variance = (alpha * width) ** 2 + sigma**2
    mean = square + alpha * width**2 / variance * (x - alpha * square)
    expected = (x - mean) / sigma
    torch.testing.assert_close(sampler._velocity(square, x, sigma), expected)


def test_more_sampler_steps_come_nearer_to_the_end() -> None:
    rng = np.random.Generator(np.random.PCG64(1))
    squares = torch.from_numpy(rng.uniform(-1, 1, (40, 12)).astype(np.float32))
    noise = torch.from_numpy(rng.standard_normal((32, 12)).astype(np.float32))
    exact = sampler._sample(squares, noise, 200)
    errors = [float((sampler._sample(squares, noise, n) - exact).norm()) for n in (4, 16, 64)]
    assert errors[0] > errors[1] > errors[2]
