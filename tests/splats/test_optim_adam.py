"""Adam on the device against torch.optim.Adam, and its treatment of rows that were not seen."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from luxcore.splats.device import Device, open_device
from luxcore.splats.optimizer import Adam, AdamSettings


@pytest.fixture(scope="module")
def device() -> Device:
    return open_device()


def gradients(steps: int, shape: tuple[int, ...]) -> np.ndarray:
    random = np.random.default_rng(0)
    return (random.normal(size=(steps, *shape)) * 10.0 ** random.uniform(-6, 2, shape)).astype(
        np.float32
    )


def test_matches_torch_when_all_is_visible(device: Device) -> None:
    start = np.random.default_rng(1).normal(size=(40, 3)).astype(np.float32)
    steps = gradients(20, start.shape)
    values, seen = device.array(start), device.array(np.ones(40, np.uint8))
    adam = Adam(device, AdamSettings(epsilon=1e-8))
    tensor = torch.tensor(start, requires_grad=True)
    reference = torch.optim.Adam([tensor], lr=0.01, eps=1e-8)
    for step in steps:
        adam.next_step()
        adam.apply("x", values, device.array(step), seen, 0.01)
        tensor.grad = torch.tensor(step)
        reference.step()
    # 20 steps of 0.01 with float32 moments.
    np.testing.assert_allclose(values.get(), tensor.detach().numpy(), atol=2e-6)


def test_rows_not_seen_keep_value_and_moments(device: Device) -> None:
    start = np.ones((4, 3), np.float32)
    values, everyone = device.array(start), device.array(np.ones(4, np.uint8))
    adam = Adam(device)
    adam.next_step()
    adam.apply("x", values, device.array(start), everyone, 0.1)
    before, moments = values.get(), adam.moments["x"].first.get()
    some = device.array(np.array([1, 0, 1, 0], np.uint8))
    adam.next_step()
    adam.apply("x", values, device.array(start), some, 0.1)
    np.testing.assert_array_equal(values.get()[[1, 3]], before[[1, 3]])
    np.testing.assert_array_equal(adam.moments["x"].first.get()[[1, 3]], moments[[1, 3]])
    assert (values.get()[[0, 2]] < before[[0, 2]]).all()


def test_projection_keeps_the_gradient_alive(device: Device) -> None:
    """A clamp in the forward pass would leave a value at the bound for ever."""
    values, seen = (
        device.array(np.full((1, 1), 0.05, np.float32)),
        device.array(np.ones(1, np.uint8)),
    )
    adam = Adam(device)
    for push in [1.0] * 3 + [-1.0] * 30:
        adam.next_step()
        adam.apply(
            "x", values, device.array(np.full((1, 1), push, np.float32)), seen, 0.1, lower=0.0
        )
        assert values.get() >= 0
    assert values.get() > 0.5


def test_zero_gradients_and_zero_rows(device: Device) -> None:
    values, seen = device.array(np.ones((3, 2), np.float32)), device.array(np.ones(3, np.uint8))
    adam = Adam(device)
    adam.next_step()
    adam.apply("x", values, device.zeros((3, 2)), seen, 0.1)
    np.testing.assert_array_equal(values.get(), 1)
    adam.apply(
        "none", device.zeros((0, 2)), device.zeros((0, 2)), device.zeros((0,), np.uint8), 0.1
    )


def test_state_continues_with_the_same_bits(device: Device) -> None:
    steps, seen = gradients(6, (5, 2)), device.array(np.ones(5, np.uint8))
    whole, resumed = (device.zeros((5, 2)) for _ in range(2))
    one, two, three = Adam(device), Adam(device), Adam(device)
    for step in steps:
        one.next_step()
        one.apply("x", whole, device.array(step), seen, 0.1)
    for step in steps[:3]:
        two.next_step()
        two.apply("x", resumed, device.array(step), seen, 0.1)
    three.load(two.state())
    for step in steps[3:]:
        three.next_step()
        three.apply("x", resumed, device.array(step), seen, 0.1)
    np.testing.assert_array_equal(resumed.get(), whole.get())
