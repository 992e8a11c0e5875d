"""The order of passes: a pure function, checked on small hand-made and random captures."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from luxcore.cameras import look_at
from luxcore.errors import InputError
from luxcore.harmonize.plan import PassPlan, plan_passes
from luxcore.harmonize.poses import pose_distance, views_linked


def line(views: int) -> tuple[np.ndarray, np.ndarray]:
    """Views in a row, each linked to all others."""
    place = np.arange(views, dtype=float)
    return np.abs(place[:, None] - place), np.ones((views, views), bool)


def targets(plan: PassPlan) -> list[int]:
    return [view for step in plan.passes for view in step.targets]


@pytest.mark.parametrize("views", [1, 15, 16, 40, 1000])
def test_every_view_is_a_target_once_and_passes_hold_15(views: int) -> None:
    plan = plan_passes(*line(views), [0])
    assert sorted(targets(plan)) == list(range(views))
    for step in plan.passes:
        assert step.references == (0,)
        assert len(step.targets) + len(step.references) + len(step.secondary) <= 15


def test_the_first_pass_takes_what_is_nearest_to_the_references() -> None:
    plan = plan_passes(*line(40), [20], max_views=6)
    assert sorted(plan.passes[0].targets) == [18, 19, 20, 21, 22]


def test_later_passes_hand_light_on_from_the_nearest_finished_view() -> None:
    plan = plan_passes(*line(12), [0], max_views=6)
    assert plan.passes[1].secondary == (4,)
    assert plan.passes[1].targets == (5, 6, 7, 8)
    assert plan.passes[2].secondary == (8,)


def test_without_chaining_there_are_no_second_references() -> None:
    plan = plan_passes(*line(30), [0], chain=False)
    assert all(step.secondary == () for step in plan.passes)
    assert len(plan.passes) == 3


def test_a_second_reference_is_always_done_before() -> None:
    done: set[int] = set()
    for step in plan_passes(*line(60), [3, 40], max_views=7).passes:
        assert set(step.secondary) <= done
        done |= set(step.targets)


def test_ties_go_to_the_lower_number_and_equal_cameras_are_no_trouble() -> None:
    plan = plan_passes(np.zeros((20, 20)), np.ones((20, 20), bool), [7], max_views=5)
    assert targets(plan)[:4] == [0, 1, 2, 3]
    assert plan == plan_passes(np.zeros((20, 20)), np.ones((20, 20), bool), [7], max_views=5)


def test_disconnected_views_are_named_and_come_last() -> None:
    distance, linked = line(6)
    linked[4:, :4] = linked[:4, 4:] = False
    distance[4] = distance[:, 4] = 0.01
    plan = plan_passes(distance, linked, [0], max_views=3, chain=False)
    assert plan.disconnected == (4, 5)
    assert targets(plan)[-2:] == [4, 5]


def test_links_reach_through_other_views() -> None:
    distance, _ = line(6)
    linked = np.abs(np.subtract.outer(np.arange(6), np.arange(6))) <= 1
    assert plan_passes(distance, linked, [0]).disconnected == ()


@pytest.mark.parametrize("references", [[], [5], [-1]])
def test_references_must_be_views(references: list[int]) -> None:
    with pytest.raises(InputError, match="references must be among the 5 views"):
        plan_passes(*line(5), references)


def test_references_that_fill_a_pass_are_refused() -> None:
    with pytest.raises(InputError, match="15 reference views leave no room"):
        plan_passes(*line(20), range(15))
    assert sorted(targets(plan_passes(*line(20), range(14)))) == list(range(20))


@settings(max_examples=40, deadline=None)
@given(
    views=st.integers(1, 40),
    size=st.integers(2, 15),
    chain=st.booleans(),
    seed=st.integers(0, 1000),
)
def test_any_capture_is_covered(views: int, size: int, chain: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    half = rng.random((views, views))
    references = rng.choice(views, min(views, size - 1), replace=False).tolist()
    plan = plan_passes(half + half.T, half + half.T > 0.8, references, max_views=size, chain=chain)
    assert sorted(targets(plan)) == list(range(views))
    for step in plan.passes:
        assert step.targets
        assert len(step.targets) + len(step.references) + len(step.secondary) <= size


def test_pose_distance_grows_with_steps_and_turns_and_ignores_scale() -> None:
    def cameras(scale: float) -> list:
        eyes = np.array([[0, 0, 0], [0, 1, 0], [0, 3, 0], [0, 0, 0]]) * scale
        aims = eyes + np.array([[1, 0, 0], [1, 0, 0], [1, 0, 0], [0, 1, 0]])
        return [look_at(e, a, 60.0, 64, 64) for e, a in zip(eyes, aims, strict=True)]

    distance = pose_distance(cameras(1.0))
    assert distance[0, 1] < distance[0, 2]
    assert distance[0, 3] == pytest.approx(1.0)
    np.testing.assert_allclose(distance, distance.T)
    np.testing.assert_allclose(distance, pose_distance(cameras(100.0)))
    assert not views_linked(cameras(1.0))[0, 3]
    assert views_linked(cameras(1.0))[0, 2]


def test_one_view_and_equal_views_have_distance_zero() -> None:
    camera = look_at(np.zeros(3), np.array([1.0, 0, 0]), 60.0, 64, 64)
    assert pose_distance([camera]).tolist() == [[0.0]]
    assert pose_distance([camera, camera]).tolist() == [[0.0, 0.0], [0.0, 0.0]]
