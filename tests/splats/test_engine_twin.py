"""The kernels against their float64 torch twin, and the twin against finite differences."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from engine_scenes import (
    NAMES,
    camera_at_origin,
    random_scene,
    relative,
    run_engine,
    run_twin,
    upstream_gradients,
)

from luxcore.splats.device import open_device
from luxcore.splats.rasterizer import RasterConfig
from luxcore.splats.twin import rasterize

# float32 noise of a public implementation at 10,000 Gaussians is 1e-5 and 6.5e-5.
IMAGE_TOLERANCE = 3e-5
GRADIENT_TOLERANCE = 2e-4


@pytest.mark.parametrize(
    ("mapping", "antialiased", "count", "channels"),
    [("block", False, 300, 3), ("block", True, 200, 14), ("pixel", True, 200, 3)],
)
def test_image_and_every_gradient_match_the_twin(mapping, antialiased, count, channels):
    camera, config = camera_at_origin(), RasterConfig(channels, antialiased)
    scene = random_scene(count, channels)
    out, gradients, upstream = run_engine(open_device(mapping=mapping), camera, config, scene)
    twin, twin_gradients = run_twin(camera, config, scene, upstream)
    for name in ("image", "alpha", "depth"):
        expected = getattr(twin, name).detach().numpy()
        assert relative(getattr(out, name).get(), expected) < IMAGE_TOLERANCE, name
    for name in NAMES:
        actual, expected = getattr(gradients, name).get(), twin_gradients[name]
        assert relative(actual, expected) < GRADIENT_TOLERANCE, name
    visible = twin.projected.visible.numpy()
    np.testing.assert_array_equal(gradients.visible.get() > 0, visible & (out.radii.get() > 0))


def test_many_gaussians_flip_few_pixels_and_without_bias():
    """A pixel may fall on the other side of a cut-off; few do, and not all in one direction."""
    camera, config = camera_at_origin(96, 64), RasterConfig(3)
    scene = random_scene(1500, scale=0.05, camera=camera)
    out, gradients, upstream = run_engine(open_device(), camera, config, scene)
    twin, twin_gradients = run_twin(camera, config, scene, upstream)
    expected = twin.image.detach().numpy()
    difference = out.image.get() - expected
    assert (np.abs(difference).max(-1) > 1e-3).mean() <= 1e-3
    assert abs(difference.mean()) < 1e-6
    assert relative(out.image.get(), expected) < 1e-4
    for name in NAMES:
        assert relative(getattr(gradients, name).get(), twin_gradients[name]) < 1e-3, name


def test_no_gaussian_lacks_its_gradient():
    """Row by row: a missing small gradient would hide in a norm over all rows."""
    camera, config, scene = camera_at_origin(), RasterConfig(3), random_scene(300)
    _, gradients, upstream = run_engine(open_device(), camera, config, scene)
    _, twin_gradients = run_twin(camera, config, scene, upstream)
    for name in NAMES:
        expected = twin_gradients[name].reshape(300, -1)
        actual = getattr(gradients, name).get().reshape(300, -1)
        size = np.linalg.norm(expected, axis=1)
        clear = size > 1e-4 * size.max()
        ratio = np.linalg.norm(actual, axis=1)[clear] / size[clear]
        np.testing.assert_allclose(ratio, 1, atol=5e-3)


@pytest.mark.parametrize("antialiased", [False, True])
def test_twin_matches_finite_differences(antialiased):
    """Central differences along random directions; steps too small to cross a cut-off."""
    camera, config = camera_at_origin(24, 20, focal=22.0), RasterConfig(2, antialiased)
    scene = random_scene(12, 2, camera=camera, scale=0.3, seed=3)
    upstream = [torch.tensor(u, dtype=torch.float64) for u in upstream_gradients(camera, 2)]
    inputs = [torch.tensor(getattr(scene, n), dtype=torch.float64) for n in NAMES]

    def loss(values):
        out = rasterize(camera, config, *values)
        parts = (out.image, out.alpha, out.depth)
        return sum((part * u).sum() for part, u in zip(parts, upstream, strict=True))

    leaves = [t.clone().requires_grad_(True) for t in inputs]
    gradients = torch.autograd.grad(loss(leaves), leaves)
    generator = torch.Generator().manual_seed(0)
    for k, (name, gradient) in enumerate(zip(NAMES, gradients, strict=True)):
        direction = torch.randn(inputs[k].shape, generator=generator, dtype=torch.float64)
        step = 1e-7 * direction
        shifted = [[*inputs[:k], inputs[k] + s * step, *inputs[k + 1 :]] for s in (1, -1)]
        numeric = (loss(shifted[0]) - loss(shifted[1])) / 2e-7
        assert float(numeric) == pytest.approx(float((gradient * direction).sum()), rel=1e-4), name


def test_mappings_agree_to_the_bit_forward():
    """Both mappings round alike and stop at the same Gaussian; their sums differ in order."""
    camera, config, scene = camera_at_origin(), RasterConfig(5), random_scene(400, 5)
    block = run_engine(open_device(mapping="block"), camera, config, scene)
    pixel = run_engine(open_device(mapping="pixel"), camera, config, scene)
    for name in ("image", "alpha", "depth", "radii"):
        np.testing.assert_array_equal(getattr(block[0], name).get(), getattr(pixel[0], name).get())
    for name in NAMES:
        assert relative(getattr(block[1], name).get(), getattr(pixel[1], name).get()) < 1e-5
