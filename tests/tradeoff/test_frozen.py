"""Least squares on frozen weights against numpy's, and weights of 16 bits."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from luxcore.cameras import look_at
from luxcore.splats.baked import BakedView, bake, padded, padded_zeros
from luxcore.splats.device import open_device
from luxcore.splats.gaussians import Gaussians
from luxcore.splats.light_fit import LightFit
from luxcore.splats.model import DeviceGaussians
from luxcore.splats.rasterizer import RasterConfig, Rasterizer
from luxcore.tradeoff.knobs.frozen import least_squares

COUNT, CHANNELS, SIZE = 12, 6, (24, 32)


def gaussians() -> Gaussians:
    rng = np.random.Generator(np.random.PCG64(3))
    return Gaussians(
        rng.uniform(-0.6, 0.6, (COUNT, 3)).astype(np.float32),
        rng.standard_normal((COUNT, 4)).astype(np.float32),
        np.full((COUNT, 3), -1.8, np.float32),
        np.full(COUNT, 1.0, np.float32),
        np.zeros((COUNT, 1, 3), np.float32),
    )


@pytest.fixture(scope="module")
def made() -> tuple[LightFit, np.ndarray]:
    """What `least_squares` reads of a fit: two views of Gaussians whose lights are known."""
    device = open_device()
    model = DeviceGaussians.upload(device, gaussians())
    rasterizer = Rasterizer(device, RasterConfig(channels=CHANNELS))
    rng = np.random.Generator(np.random.PCG64(4))
    true = rng.uniform(0.2, 1.0, (COUNT, CHANNELS)).astype(np.float32)
    cameras = [
        look_at(np.array(eye), np.zeros(3), 50.0, SIZE[1], SIZE[0])
        for eye in ([0.0, -3.0, 0.5], [2.5, 1.5, 0.0])
    ]
    targets = [rasterizer.forward(c, *model.geometry, device.array(true)).image for c in cameras]
    # A real one needs a capture on disk; this has the parts that are read.
    fit = object.__new__(LightFit)
    fit.__dict__ |= {
        "device": device,
        "model": model,
        "rasterizer": rasterizer,
        "lights": padded(device, np.full_like(true, 0.5)),
        "split": SimpleNamespace(training=[0, 1]),
        "views": SimpleNamespace(cameras=cameras, targets=targets),
    }
    return fit, true


def test_least_squares_finds_the_lights_that_made_the_images(
    made: tuple[LightFit, np.ndarray],
) -> None:
    fit, true = made
    least_squares(fit, 40)
    # float32 sums in conjugate gradients: a thousandth of the light is their reach.
    np.testing.assert_allclose(fit.lights.get(), true, atol=2e-3)


def test_half_weights_draw_the_same_picture_within_their_precision(
    made: tuple[LightFit, np.ndarray],
) -> None:
    fit, true = made
    lights = padded(fit.device, true)
    out = fit.rasterizer.forward(fit.views.cameras[0], *fit.model.geometry, lights)
    baked = bake(fit.device, out)
    shape = (*SIZE, CHANNELS)

    def drawn(view: BakedView) -> np.ndarray:
        image = padded_zeros(fit.device, SIZE[0] * SIZE[1], shape)
        view.render(lights, image)
        return image.get()

    exact, half = drawn(baked), drawn(baked.halved())
    # A half has 11 bits: each of the weights, which sum to at most 1, is off by at most 2^-12.
    np.testing.assert_allclose(half, exact, atol=2.0**-11)
    assert (half != exact).any()
