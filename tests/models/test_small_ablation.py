"""The ablation's variants learn, and answer in linear light."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from luxcore.models.small.alternatives import (
    FLOW_STEPS,
    FlowBatches,
    PixelBatches,
    compare,
    sample_flow,
)
from luxcore.models.small.batches import SingleBatches
from luxcore.models.small.features import SV_CHANNELS
from luxcore.models.small.levels import display_curve, linear_of
from luxcore.models.small.network import NetworkShape, UNet
from luxcore.models.small.samples import CropPool
from luxcore.models.small.sketch import SketchRooms
from luxcore.models.small.training import SHAPES, single_cases
from tests.models.sketched import TINY


@pytest.fixture(scope="module")
def pool() -> CropPool:
    return CropPool.collect(SketchRooms(1000, 32, 0), range(2), 2)


def test_the_display_curve_is_undone() -> None:
    light = torch.logspace(-2, 1.2, 20)
    torch.testing.assert_close(linear_of(display_curve(light)), light, rtol=1e-3, atol=1e-4)


def test_flow_starts_at_noise_and_its_velocity_leads_to_the_target(pool: CropPool) -> None:
    source = PixelBatches(SingleBatches(pool, 5, photos=1))
    flow = FlowBatches(source)
    (features, velocity), (_, target) = flow.batch(3)[0], source.batch(3)[0]
    here, time = features[:, SV_CHANNELS : SV_CHANNELS + 3], features[:, -1:]
    torch.testing.assert_close(here + (1 - time) * velocity, target, rtol=1e-4, atol=1e-4)
    again = flow.batch(3)[0][0]
    torch.testing.assert_close(again, features, rtol=0, atol=0)


def test_a_perfect_flow_arrives_in_any_number_of_steps(pool: CropPool) -> None:
    features, example = SingleBatches(pool, 5, photos=1).batch(0)[0]
    target = 2 * display_curve(example.lights) - 1

    class Straight(UNet):
        def forward(self, features: torch.Tensor) -> torch.Tensor:
            here, time = features[:, SV_CHANNELS : SV_CHANNELS + 3], features[:, -1:]
            return (target - here) / (1 - time)

    net = Straight(NetworkShape(SV_CHANNELS + 4, 3, TINY))
    for steps in FLOW_STEPS:
        light = sample_flow(net, steps)(features, example)
        torch.testing.assert_close(display_curve(light), (target + 1) / 2, rtol=0, atol=2e-3)


def test_every_variant_is_scored(pool: CropPool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SHAPES, "sv", replace(SHAPES["sv"], widths=TINY, together=2))
    monkeypatch.setattr("luxcore.models.small.alternatives.shipped_network", lambda kind: None)
    scores = compare(pool, single_cases(pool, 0), steps=1, photos=1, rate=1e-3, seed=0)
    assert list(scores) == ["fractions", "pixels", *(f"flow, {n} steps" for n in FLOW_STEPS)]
    assert all(0 < row["lamp on"] < 60 for row in scores.values())
