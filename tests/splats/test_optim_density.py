"""Density control: both strategies, their edits, and what must survive them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_optim_ply import random_gaussians

from luxcore.splats.density import (
    McmcSettings,
    McmcStrategy,
    StandardSettings,
    StandardStrategy,
)
from luxcore.splats.density.mcmc import regularizer
from luxcore.splats.density.quaternions import rotate
from luxcore.splats.density.standard import _Statistics
from luxcore.splats.device import Device, open_device
from luxcore.splats.gaussians import Gaussians
from luxcore.splats.model import DeviceGaussians
from luxcore.splats.rasterizer import RasterGradients

STANDARD = StandardSettings(start=0, stop=100, every=10, max_gaussians=60)
MCMC = McmcSettings(start=0, stop=100, every=10, max_gaussians=60)


@pytest.fixture(scope="module")
def device() -> Device:
    return open_device()


def population(n: int = 50) -> Gaussians:
    gaussians = random_gaussians(n)
    log_scales = np.log(np.full((n, 3), 0.005, np.float32))
    log_scales[n // 2 :] = np.log(0.05)
    return replace(gaussians, log_scales=log_scales, opacity_logits=np.full(n, 1.0, np.float32))


def standard(device: Device, pull: np.ndarray, settings: StandardSettings) -> StandardStrategy:
    strategy = StandardStrategy(device, 1.0, settings)
    n = len(pull)
    arrays = (pull.astype(np.float32), np.ones(n, np.float32), np.ones(n, np.float32))
    strategy._statistics = _Statistics(*(device.array(a) for a in arrays))
    return strategy


def test_small_are_cloned_large_are_split(device: Device) -> None:
    gaussians = population()
    pull = np.zeros(50)
    pull[[3, 40]] = 1.0
    strategy = standard(device, pull, STANDARD)
    edit = strategy.refine(DeviceGaussians.upload(device, gaussians), 10, np.random.default_rng(0))
    assert edit is not None
    assert list(edit.parents) == [*range(50), 3, 40]
    clone, halves = edit.gaussians.take(np.array([50])), edit.gaussians.take(np.array([40, 51]))
    np.testing.assert_array_equal(clone.means, gaussians.means[[3]])
    np.testing.assert_allclose(np.exp(halves.log_scales), 0.05 / 1.6, rtol=1e-5)
    assert (np.abs(halves.means - gaussians.means[40]) > 0).any(axis=1).all()
    # The untouched keep their moments, the new and the split forget them.
    assert list(np.flatnonzero(edit.fresh)) == [40, 50, 51]


def test_cap_takes_the_hardest_pulled(device: Device) -> None:
    pull = np.linspace(0.1, 1.0, 50)
    strategy = standard(device, pull, replace(STANDARD, max_gaussians=55))
    edit = strategy.refine(
        DeviceGaussians.upload(device, population()), 10, np.random.default_rng(0)
    )
    assert edit is not None
    assert sorted(edit.parents[50:]) == [45, 46, 47, 48, 49]


def test_faint_giant_and_broken_are_pruned(device: Device) -> None:
    gaussians = population()
    gaussians.opacity_logits[0] = -10
    gaussians.log_scales[1] = 3
    gaussians.means[2] = np.nan
    strategy = standard(device, np.zeros(50), STANDARD)
    edit = strategy.refine(DeviceGaussians.upload(device, gaussians), 10, np.random.default_rng(0))
    assert edit is not None
    assert list(edit.parents) == list(range(3, 50))


def test_reset_stays_far_above_the_cut_off(device: Device) -> None:
    """At 1/255 the rasterizer drops a Gaussian and its gradient: it could never return."""
    gaussians = population()
    strategy = standard(device, np.zeros(50), replace(STANDARD, reset_every=10))
    edit = strategy.refine(DeviceGaussians.upload(device, gaussians), 10, np.random.default_rng(0))
    assert edit is not None
    opacity = 1 / (1 + np.exp(-edit.gaussians.opacity_logits))
    np.testing.assert_allclose(opacity, 0.1, rtol=1e-5)


def test_needles_are_split_along_themselves() -> None:
    """A child drawn from a round neighbourhood of a needle would leave its line."""
    quats = np.array([[np.cos(0.4), 0, 0, np.sin(0.4)]], np.float32)
    along = rotate(quats, np.array([[1.0, 0, 0]], np.float32))
    np.testing.assert_allclose(along, [[np.cos(0.8), np.sin(0.8), 0]], atol=1e-6)


def test_mcmc_relocates_the_dead_and_grows_to_the_cap(device: Device) -> None:
    gaussians = population()
    gaussians.opacity_logits[:5] = -8.0
    strategy = McmcStrategy(device, 1.0, 1e-4, 0, replace(MCMC, max_gaussians=52))
    edit = strategy.refine(DeviceGaussians.upload(device, gaussians), 10, np.random.default_rng(0))
    assert edit is not None
    assert len(edit.gaussians) == 52
    assert (edit.parents >= 5).all()
    assert edit.fresh[:5].all()
    assert edit.fresh[50:].all()


def test_mcmc_copies_look_like_their_original(device: Device) -> None:
    """Blending N copies along a ray through the centre gives the opacity of the one before."""
    gaussians = replace(population(1), opacity_logits=np.full(1, 2.0, np.float32))
    strategy = McmcStrategy(device, 1.0, 1e-4, 0, replace(MCMC, growth=2.0))
    edit = strategy.refine(DeviceGaussians.upload(device, gaussians), 10, np.random.default_rng(0))
    assert edit is not None
    opacity = 1 / (1 + np.exp(-edit.gaussians.opacity_logits.astype(np.float64)))
    before = 1 / (1 + np.exp(-2.0))
    assert 1 - np.prod(1 - opacity) == pytest.approx(before, rel=1e-5)
    assert (edit.gaussians.log_scales <= gaussians.log_scales).all()


def test_mcmc_regularizer_gradient_by_finite_differences(device: Device) -> None:
    gaussians, strategy = random_gaussians(8), McmcStrategy(device, 2.0, 1e-4, 0, MCMC)
    model = DeviceGaussians.upload(device, gaussians)
    zeros = {
        name: device.zeros(getattr(gaussians, name).shape)
        for name in ("means", "quats", "log_scales", "opacity_logits")
    }
    gradients = RasterGradients(
        **zeros, colors=device.zeros((8, 3)), mean2d_norm=device.zeros((8,)),
        visible=device.zeros((8,), np.uint8),
    )  # fmt: skip
    strategy.before_step(model, gradients)
    step = 1e-2
    for name in ("opacity_logits", "log_scales"):
        values = getattr(gaussians, name)
        shift = np.zeros_like(values)
        shift.reshape(-1)[0] = step
        ahead = regularizer(replace(gaussians, **{name: values + shift}), MCMC, 2.0)
        behind = regularizer(replace(gaussians, **{name: values - shift}), MCMC, 2.0)
        found = getattr(gradients, name).get().reshape(-1)[0]
        # Central differences of float32 parameters with a step of 1e-2: 1e-3 relative.
        assert found == pytest.approx((ahead - behind) / (2 * step), rel=2e-3)


def test_mcmc_noise_is_larger_for_faint_and_the_same_for_the_same_seed(device: Device) -> None:
    gaussians = replace(population(400), log_scales=np.full((400, 3), -2.0, np.float32))
    gaussians.opacity_logits[:200], gaussians.opacity_logits[200:] = -8.0, 8.0
    moved = []
    for seed in (0, 0, 1):
        strategy = McmcStrategy(device, 1.0, 1e-4, seed, MCMC)
        model = DeviceGaussians.upload(device, gaussians)
        strategy.shake(model, 7)
        moved.append(model.means.get() - gaussians.means)
    np.testing.assert_array_equal(moved[0], moved[1])
    assert (moved[0] != moved[2]).any()
    # Σ · noise · 5e5 · 1e-4 · gate, with gate 0.62 for the faint and e^-99 for the opaque.
    expected = np.exp(-4.0) * 50 / (1 + np.exp(-100 * (0.005 - 1 / (1 + np.exp(8.0)))))
    assert moved[0][:200].std() == pytest.approx(expected, rel=0.1)
    assert np.abs(moved[0][200:]).max() < 1e-6
