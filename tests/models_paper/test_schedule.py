"""Which examples a step sees: every one once, whatever the number of devices."""

from __future__ import annotations

import pytest

from luxcore.errors import InputError
from luxcore.models.diffusion.randomness import torch_generator
from luxcore.models.diffusion.schedule import ExampleKey, Plan
from luxcore.settings.paper_models import MultiViewTraining, TrainingPhase

PHASES = (
    TrainingPhase(steps=2, batch_size=6, views=4),
    TrainingPhase(steps=1, batch_size=4, views=8),
)


def test_every_example_is_seen_once_with_its_phase_s_views() -> None:
    plan = Plan(PHASES, micro_batch=4)
    keys = [key for step in range(plan.steps) for key in plan.keys(step)]
    assert plan.steps == 3
    assert keys == [ExampleKey(i, 4) for i in range(12)] + [ExampleKey(i, 8) for i in range(12, 16)]


@pytest.mark.parametrize("world", [1, 2])
def test_devices_share_a_step_without_overlap(world: int) -> None:
    whole = Plan(PHASES, micro_batch=4)
    shares = [Plan(PHASES, 4, world, rank) for rank in range(world)]
    for step in range(whole.steps):
        together = sorted(key for share in shares for key in share.keys(step))
        assert together == whole.keys(step)


def test_micro_batches_cover_the_share_and_start_anywhere() -> None:
    plan = Plan(PHASES, micro_batch=4)
    assert [len(group) for group in plan.micro_batches(0)] == [4, 2]
    assert list(plan.micro_batches_from(1)) == [*plan.micro_batches(1), *plan.micro_batches(2)]


def test_a_batch_that_devices_cannot_share_is_refused() -> None:
    with pytest.raises(InputError, match="batch of 4 cannot be shared by 3 devices"):
        Plan(PHASES, 1, world=3)


def test_the_paper_s_48_devices_share_every_phase() -> None:
    plan = Plan(MultiViewTraining().phases, micro_batch=1, world=48, rank=47)
    assert [len(plan.keys(step)) for step in (0, 15_000, 29_999)] == [4, 3, 2]
    assert plan.steps == 30_000
    with pytest.raises(IndexError):
        plan.keys(30_000)


def test_noise_depends_on_every_part_of_its_name_and_on_nothing_else() -> None:
    import torch

    def draw(*entropy: int) -> float:
        return float(torch.rand((), dtype=torch.float64, generator=torch_generator(*entropy)))

    assert draw(0, 0) == draw(0, 0)
    names = [(0, 0), (0, 1), (1, 0), (2**40, 0), (0, 2**40), (0, 0, 1)]
    assert len({draw(*name) for name in names}) == len(names)
