"""Loss kernels against their torch twins in float64, forward and gradient, and the hard cases."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from luxcore.splats.device import Device, open_device
from luxcore.splats.losses import twin
from luxcore.splats.losses.composition import (
    CompositionLoss,
    ToneCurve,
    raw_parameters,
    read_parameters,
)
from luxcore.splats.losses.constants import CLIPPED
from luxcore.splats.losses.image import ImageLoss
from luxcore.splats.losses.smoothness import (
    ABSENT,
    SmoothnessLoss,
    mean_neighbor_distance,
    nearest_neighbors,
)

SIZES = [
    (1, 1, 3), (1, 40, 1), (37, 1, 3), (16, 16, 1), (23, 31, 3), (9, 13, 5),
    # In strips on CPUs: smaller than the window, several strips, whole and overlapping groups.
    (1, 1, 8), (2, 3, 9), (24, 20, 27), (11, 150, 12), (30, 66, 16),
]  # fmt: skip


@pytest.fixture(scope="module")
def device() -> Device:
    return open_device()


@pytest.fixture(scope="module", params=["block", "pixel"])
def either(request: pytest.FixtureRequest) -> Device:
    """The losses have a way for CPUs and one for GPUs."""
    return open_device(mapping=request.param)


def images(shape: tuple[int, ...], seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    y = random.random(shape, np.float32)
    # Away from x = y, where |x - y| has no derivative.
    offset = random.uniform(0.02, 0.3, shape) * random.choice([-1, 1], shape)
    return (y + offset).astype(np.float32), y


def relative(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm(a - b) / max(np.linalg.norm(b), 1e-30))


def run_image_loss(
    device: Device, x: np.ndarray, y: np.ndarray, l1: float, ssim: float
) -> tuple[float, np.ndarray]:
    loss = ImageLoss(device, x.shape[:2], x.shape[2], l1, ssim)
    d_x = device.array(np.full(x.shape, np.nan, np.float32))
    loss.gradient(device.array(x), device.array(y), d_x)
    return loss.value(), d_x.get()


def twin_image_loss(
    x: np.ndarray, y: np.ndarray, l1: float, ssim: float
) -> tuple[float, np.ndarray]:
    tensor = torch.tensor(x, dtype=torch.float64, requires_grad=True)
    value = twin.image_loss(tensor, torch.tensor(y, dtype=torch.float64), l1, ssim)
    value.backward()
    assert tensor.grad is not None
    return float(value.detach()), tensor.grad.numpy()


@pytest.mark.parametrize("shape", SIZES)
@pytest.mark.parametrize("weights", [(0.8, 0.2), (1.0, 0.0), (0.0, 1.0)])
def test_image_loss_matches_twin(
    either: Device, shape: tuple[int, int, int], weights: tuple[float, float]
) -> None:
    x, y = images(shape)
    value, gradient = run_image_loss(either, x, y, *weights)
    expected, expected_gradient = twin_image_loss(x, y, *weights)
    # float32 moments lose about 1e-6 of a variance that is 1e-2: 1e-4 of the gradient.
    assert value == pytest.approx(expected, rel=2e-6, abs=1e-6)
    assert relative(gradient, expected_gradient) < 2e-4


def test_image_loss_gradient_by_finite_differences() -> None:
    x, y = images((6, 7, 2))
    _, gradient = twin_image_loss(x, y, 0.8, 0.2)
    step, wide, target = 1e-5, x.astype(np.float64), torch.tensor(y, dtype=torch.float64)
    for at in [(0, 0, 0), (3, 2, 1), (5, 6, 0)]:
        up, down = wide.copy(), wide.copy()
        up[at] += step
        down[at] -= step
        difference = twin.image_loss(torch.tensor(up), target, 0.8, 0.2) - twin.image_loss(
            torch.tensor(down), target, 0.8, 0.2
        )
        assert float(difference) / (2 * step) == pytest.approx(gradient[at], rel=1e-6)


@pytest.mark.parametrize("level", [0.0, 0.3, 1.0, 1000.0])
@pytest.mark.parametrize("channels", [3, 9])
def test_flat_images_have_ssim_one_and_no_noise(
    device: Device, level: float, channels: int
) -> None:
    """Rounding makes a flat region's variance negative: unclamped, SSIM leaves [-1, 1]."""
    flat = np.full((40, 48, channels), level, np.float32)
    value, gradient = run_image_loss(device, flat, flat, 0.0, 1.0)
    assert value == pytest.approx(0.0, abs=1e-5)
    # Every derivative of SSIM vanishes at x = y; noise of variances is divided by C2 = 9e-4.
    assert np.abs(gradient).max() < 1e-6


@pytest.mark.parametrize("channels", [3, 9])
def test_ssim_never_exceeds_one_on_noisy_flat_hdr(device: Device, channels: int) -> None:
    random = np.random.default_rng(0)
    x = (1e4 + random.normal(size=(32, 32, channels))).astype(np.float32)
    value, gradient = run_image_loss(device, x, x, 0.0, 1.0)
    assert -1e-6 <= value <= 1.0
    assert np.isfinite(gradient).all()


def test_image_loss_is_bit_equal_between_runs(device: Device) -> None:
    x, y = images((33, 47, 9))
    first, again = (run_image_loss(device, x, y, 1.0, 0.2) for _ in range(2))
    assert first[0] == again[0]
    np.testing.assert_array_equal(first[1], again[1])


def composition_case(
    lights: int, seed: int = 0
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    x = random.uniform(0.05, 1.0, (11, 17, 3 * lights)).astype(np.float32)
    photo = random.uniform(0.0, 0.9, (11, 17, 3)).astype(np.float32)
    weights = random.uniform(0.2, 1.2, (lights, 3)).astype(np.float32)
    units = random.uniform(0.1, 5.0, lights).astype(np.float32)
    return x, photo, raw_parameters(weights, ToneCurve(0.01, 2.2)), units


def run_composition(
    device: Device, x: np.ndarray, photo: np.ndarray, params: np.ndarray, units: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray]:
    loss = CompositionLoss(device, x.shape[:2], units, 0.5)
    d_x = device.zeros(x.shape)
    loss.gradient(device.array(x), device.array(photo), device.array(params), d_x)
    return loss.value(), d_x.get(), loss.d_params.get()


@pytest.mark.parametrize("lights", [1, 3, 9])
def test_composition_matches_twin(device: Device, lights: int) -> None:
    x, photo, params, units = composition_case(lights)
    photo[0, :4] = CLIPPED
    value, d_x, d_params = run_composition(device, x, photo, params, units)
    x_t, p_t = (torch.tensor(a, dtype=torch.float64, requires_grad=True) for a in (x, params))
    loss = 0.5 * twin.composition_loss(
        x_t, torch.tensor(photo).double(), p_t, torch.tensor(units).double()
    )
    loss.backward()
    assert x_t.grad is not None
    assert p_t.grad is not None
    assert value == pytest.approx(float(loss.detach()), rel=1e-5)
    assert relative(d_x, x_t.grad.numpy()) < 1e-5
    assert relative(d_params, p_t.grad.numpy()) < 1e-4


def test_composition_gradient_by_finite_differences() -> None:
    x, photo, params, units = composition_case(2)
    arrays = [torch.tensor(a).double() for a in (x, photo, units)]
    p_t = torch.tensor(params).double().requires_grad_()
    twin.composition_loss(arrays[0], arrays[1], p_t, arrays[2]).backward()
    assert p_t.grad is not None
    for index in range(len(params)):
        step = torch.zeros(len(params)).double()
        step[index] = 1e-6
        values = [
            twin.composition_loss(arrays[0], arrays[1], p_t.detach() + s, arrays[2])
            for s in (step, -step)
        ]
        numeric = float(values[0] - values[1]) / 2e-6
        assert numeric == pytest.approx(float(p_t.grad[index]), rel=1e-4, abs=1e-9)


@pytest.mark.parametrize("raw", [(-200.0, -200.0), (200.0, 200.0), (-200.0, 200.0), (0.0, -50.0)])
def test_tone_curve_stays_finite_at_its_ends(device: Device, raw: tuple[float, float]) -> None:
    """(x + β)^(1/γ) has an infinite derivative at x = 0 for β → 0, an infinite value for γ → 0."""
    x, photo, params, units = composition_case(2)
    x[:4], x[4:6] = 0.0, 1e6
    params[-2:] = raw
    for values in run_composition(device, x, photo, params, units):
        assert np.isfinite(values).all()


def test_negative_totals_do_not_break_the_power(device: Device) -> None:
    x, photo, params, units = composition_case(2)
    for values in run_composition(device, -x, photo, params, units):
        assert np.isfinite(values).all()


def test_clipped_photo_does_not_pull_bright_light_down(device: Device) -> None:
    x, photo, params, units = composition_case(1)
    x[:], photo[:] = 1000.0, CLIPPED
    value, d_x, d_params = run_composition(device, x, photo, params, units)
    assert value == 0
    assert not d_x.any()
    assert not d_params.any()


def test_raw_parameters_round_trip() -> None:
    weights = np.array([[0.1, 0.5, 2.0], [0.0, 1.0, 1.5]], np.float32)
    read, curve = read_parameters(raw_parameters(weights, ToneCurve(0.02, 2.4)))
    np.testing.assert_array_equal(read, weights)
    assert (curve.beta, curve.gamma) == pytest.approx((0.02, 2.4), rel=1e-5)


@pytest.mark.parametrize(("n", "k"), [(50, 5), (4, 8), (1, 3), (2, 1)])
def test_smoothness_matches_twin(device: Device, n: int, k: int) -> None:
    random = np.random.default_rng(1)
    means, lights = random.normal(size=(n, 3)), random.normal(size=(n, 6)).astype(np.float32)
    neighbors = nearest_neighbors(means, k)
    loss = SmoothnessLoss(device, neighbors, 6, 0.25)
    gradient = device.zeros(lights.shape)
    loss.add_gradient(device.array(lights), gradient)
    tensor = torch.tensor(lights, dtype=torch.float64, requires_grad=True)
    expected = 0.25 * twin.smoothness_loss(tensor, torch.tensor(neighbors).long())
    expected.backward()
    assert tensor.grad is not None
    assert loss.value() == pytest.approx(float(expected.detach()), rel=1e-5, abs=1e-12)
    assert np.abs(gradient.get() - tensor.grad.numpy()).max() < 1e-6


def test_neighbors_with_duplicates_and_too_few() -> None:
    means = np.zeros((6, 3))
    means[5] = 1.0
    table = nearest_neighbors(means, 8)
    for row, ids in enumerate(table):
        present = ids[ids != ABSENT]
        assert sorted(present) == [i for i in range(6) if i != row]
    assert (mean_neighbor_distance(means, 3, floor=1e-4) >= 1e-4).all()


def test_neighbors_are_the_nearest() -> None:
    means = np.random.default_rng(3).normal(size=(40, 3))
    distance = np.linalg.norm(means[:, None] - means[None], axis=2)
    np.fill_diagonal(distance, np.inf)
    expected = np.sort(np.argsort(distance, axis=1)[:, :4], axis=1)
    np.testing.assert_array_equal(np.sort(nearest_neighbors(means, 4), axis=1), expected)
