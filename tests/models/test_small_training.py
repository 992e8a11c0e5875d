"""Training: pure batches, exact resume, never worse than the base."""

from __future__ import annotations

import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.random import PCG64, Generator

from luxcore.data.crops import LitCrop
from luxcore.errors import DivergedError, InputError
from luxcore.models.small.batches import Disturbance, GroupBatches, SingleBatches
from luxcore.models.small.examples import to_example
from luxcore.models.small.fit import FitSettings, fit, lamp_loss, schedule
from luxcore.models.small.network import LampNet, NetworkShape, UNet
from luxcore.models.small.samples import CropPool, relit
from luxcore.models.small.scores import mean_psnr
from luxcore.models.small.sketch import SketchRooms
from luxcore.models.small.training import (
    base_weights,
    blended,
    group_cases,
    single_cases,
    widen,
)
from luxcore.models.small.weights import CHANNELS
from luxcore.settings.train_sv import TrainingSettings
from tests.models.sketched import TINY

SETTINGS = FitSettings(steps=6, rate=1e-3, warmup=2, check_every=3)


@pytest.fixture(scope="module")
def pool() -> CropPool:
    return CropPool.collect(SketchRooms(1000, 32, 0), range(3), 2)


def tiny(kind: str) -> LampNet:
    torch.manual_seed(0)
    return LampNet(NetworkShape(*CHANNELS[kind], TINY))


def trained(pool: CropPool, settings: FitSettings, checkpoint: Path | None = None) -> dict:
    score = single_cases(pool, 0)
    batches = SingleBatches(pool, 5, photos=2)
    return fit(
        tiny("sv"),
        batches,
        settings,
        lambda n: {"psnr_validation": mean_psnr(n, score)},
        checkpoint,
    ).weights


def test_sketched_rooms_are_the_same_every_time_and_differ_by_number() -> None:
    first, again = SketchRooms(1000, 32, 0).crops(4, 1), SketchRooms(1000, 32, 0).crops(4, 1)
    other = SketchRooms(1000, 32, 0).crops(5, 1)
    np.testing.assert_array_equal(first[0].lights, again[0].lights)
    assert not np.array_equal(first[0].depth_m, other[0].depth_m)


def test_sketched_light_is_finite_positive_and_falls_off() -> None:
    for number in range(6):
        crop = SketchRooms(1000, 32, 0).crops(number, 1)[0]
        assert np.isfinite(crop.lights).all()
        assert (crop.lights >= 0).all()
        assert (crop.depth_m > 0).all()
        np.testing.assert_allclose(np.linalg.norm(crop.normal, axis=2), 1, atol=1e-3)


class TwoRooms:
    """Sketched photos said to be of two rooms by turns."""

    def __init__(self) -> None:
        self.made: list[int] = []

    def crops(self, index: int, views: int) -> list[LitCrop]:
        self.made.append(index)
        return SketchRooms(1000, 32, 0).crops(index, views)

    def place(self, index: int) -> int:
        return index % 2


def test_a_pool_cuts_room_by_room_and_keeps_the_order() -> None:
    source = TwoRooms()
    pool = CropPool.collect(source, range(4), 1)
    assert source.made == [0, 2, 1, 3]
    for index, (crop,) in enumerate(pool.groups):
        np.testing.assert_array_equal(crop.lights, source.crops(index, 1)[0].lights)


@pytest.mark.parametrize("kind", [SingleBatches, GroupBatches])
def test_a_batch_depends_on_its_number_only(kind: type, pool: CropPool) -> None:
    batches = kind(pool, 5, photos=2)
    batches.batch(0)
    first, again = batches.batch(3), kind(pool, 5, photos=2).batch(3)
    for (a, _), (b, _) in zip(first, again, strict=True):
        torch.testing.assert_close(a, b, rtol=0, atol=0)
    assert not torch.equal(first[0][0], batches.batch(4)[0][0])


MADE_AHEAD = """
import torch
from luxcore.models.small.batches import SingleBatches
from luxcore.models.small.fit import prepared
from luxcore.models.small.samples import CropPool
from luxcore.models.small.sketch import SketchRooms
from luxcore.models.small.weights import shipped_network

torch.set_num_threads(2)
pool = CropPool.collect(SketchRooms(1000, 64, 0), range(2), 1)
batches = SingleBatches(pool, 5, photos=2, geometry=0.3, estimator=shipped_network("geometry"))
here, ahead = (list(prepared(batches, range(2, 5), workers)) for workers in (0, 2))
assert len(here) == len(ahead) == 3
for one, other in zip(here, ahead, strict=True):
    for (features, example), (again, same) in zip(one, other, strict=True):
        assert torch.equal(features, again)
        assert torch.equal(example.lights, same.lights)
"""


def test_batches_made_ahead_by_other_processes_are_the_same() -> None:
    # In a process of its own, as a training is: workers are forks of all that ran before.
    ran = subprocess.run([sys.executable, "-c", MADE_AHEAD], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr


def test_references_that_the_single_view_model_took_apart_tell_of_their_own_lamps_only(
    pool: CropPool,
) -> None:
    told = 0
    for group in pool.groups:
        batches = GroupBatches(CropPool((group,)), 5, photos=4, single=tiny("sv").eval())
        plain = GroupBatches(CropPool((group,)), 5, photos=4)
        if not any(view.masks.any() for view in group):
            continue
        told += 1
        for (a, _), (b, _) in zip(batches.batch(2), batches.batch(2), strict=True):
            torch.testing.assert_close(a, b, rtol=0, atol=0)
        with_model = torch.cat([f for f, _ in batches.batch(2)])
        assert torch.isfinite(with_model).all()
        assert not torch.equal(with_model, torch.cat([f for f, _ in plain.batch(2)]))
        example = to_example(group[0], geometry=True, keep=np.ones(len(group[0].on), bool))
        seen = torch.zeros(len(example.on), dtype=torch.bool)
        seen[0] = True
        always = Disturbance(Generator(PCG64(0)), tiny("sv").eval(), predicted_share=1.0)
        light = always.light(example, seen)
        assert (light[1:] == 0).all()
        assert (light[0] > 0).any()
    assert told


def test_resume_equals_an_unbroken_run(pool: CropPool, tmp_path: Path) -> None:
    checkpoint = tmp_path / "state.ckpt"
    whole = trained(pool, SETTINGS)

    class StopError(Exception):
        pass

    score = single_cases(pool, 0)
    calls: list[int] = []

    def stop_at_second_check(net: UNet) -> dict[str, float]:
        calls.append(1)
        if len(calls) == 2:
            raise StopError
        return {"psnr_validation": mean_psnr(net, score)}

    batches = SingleBatches(pool, 5, photos=2)
    with pytest.raises(StopError):
        fit(tiny("sv"), batches, SETTINGS, stop_at_second_check, checkpoint)
    resumed = trained(pool, SETTINGS, checkpoint)
    for name, value in whole.items():
        torch.testing.assert_close(resumed[name], value, rtol=0, atol=0)


def test_a_few_steps_lower_the_loss(pool: CropPool) -> None:
    batch = SingleBatches(pool, 5, photos=2).batch(0)
    net = tiny("sv")

    def loss() -> torch.Tensor:
        terms = [lamp_loss(net(f), e) for f, e in batch]
        return torch.stack(terms).mean()

    optimizer = torch.optim.AdamW(net.parameters(), 3e-3)
    first = float(loss().detach())
    for _ in range(12):
        optimizer.zero_grad()
        value = loss()
        value.backward()
        optimizer.step()
    assert float(loss().detach()) < 0.9 * first


def test_gradients_reach_every_weight(pool: CropPool) -> None:
    net = tiny("mv")
    for parameter in net.parameters():
        torch.nn.init.normal_(parameter, std=0.05)
    for features, example in GroupBatches(pool, 5, photos=4).batch(0):
        lamp_loss(net(features), example).backward()
    silent = [name for name, p in net.named_parameters() if not (p.grad != 0).any()]
    assert not silent


def test_training_that_diverges_says_so(pool: CropPool) -> None:
    net = tiny("sv")
    torch.nn.init.constant_(net.head.weight, float("nan"))
    with pytest.raises(DivergedError, match="step 0 is not finite"):
        fit(net, SingleBatches(pool, 5, photos=1), SETTINGS, lambda _: {})


def test_the_rate_warms_up_holds_and_ends_near_zero() -> None:
    settings = FitSettings(steps=100, rate=1.0, warmup=10, cooldown=0.4)
    shares = [schedule(step, settings) for step in range(100)]
    assert shares[0] == pytest.approx(0.1)
    assert shares[50] == 1.0
    assert shares[99] == pytest.approx(1 / 40)
    assert all(a >= b for a, b in pairwise(shares[60:]))


def test_a_photo_without_burning_lamps_shows_its_ambient_light(pool: CropPool) -> None:
    (dark,) = relit(pool.groups[0][:1], Generator(PCG64(3)), dark=True)
    assert not dark.on.any()
    np.testing.assert_array_equal(dark.image_linear, dark.ambient)
    assert dark.exposure > 0


def test_blended_weights_lie_between_the_base_and_the_trained_ones() -> None:
    base, trained_ones = {"w": torch.tensor([0.0, 2.0])}, {"w": torch.tensor([4.0, 2.0])}
    assert blended(base, trained_ones, 0.25)["w"].tolist() == [1.0, 2.0]
    assert blended(base, trained_ones, 1.0)["w"].tolist() == [4.0, 2.0]


def test_blending_needs_weights_to_start_from() -> None:
    with pytest.raises(InputError, match="base"):
        base_weights("sv", TrainingSettings(base=None, blend=0.5), None)


def test_a_widened_network_answers_as_before(pool: CropPool) -> None:
    narrow, wide = tiny("sv"), tiny("mv")
    torch.nn.init.normal_(narrow.head.weight, std=0.1)
    widen(narrow, wide)
    features, _ = group_cases(pool, 0)[0]
    with torch.no_grad():
        expected = narrow(features[:, : narrow.shape.inputs])
        torch.testing.assert_close(wide(features)[:, : narrow.shape.outputs], expected)
