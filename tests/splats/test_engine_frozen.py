"""Frozen geometry: recolouring and colour gradients give what the full passes give."""

from __future__ import annotations

import numpy as np
import pytest
from engine_scenes import camera_at_origin, on_device, random_scene, relative, run_engine

from luxcore.splats.baked import bake, bake_within, padded, padded_zeros
from luxcore.splats.device import open_device
from luxcore.splats.rasterizer import RasterConfig, Rasterizer


@pytest.mark.parametrize("mapping", ["block", "pixel"])
@pytest.mark.parametrize("channels", [3, 24])
def test_recolouring_equals_a_new_pass(mapping, channels):
    device, camera = open_device(mapping=mapping), camera_at_origin()
    scene = random_scene(200, channels)
    out, gradients, upstream = run_engine(device, camera, RasterConfig(channels), scene)
    rasterizer = Rasterizer(device, RasterConfig(channels))
    other = scene.replaced(colors=scene.colors[::-1])
    recolored = rasterizer.recolor(out, device.array(other.colors))
    expected = rasterizer.forward(camera, *on_device(device, other))
    np.testing.assert_array_equal(recolored.image.get(), expected.image.get())
    d_colors = rasterizer.color_gradients(out, device.array(upstream[0]))
    assert relative(d_colors.get(), gradients.colors.get()) < 1e-6


@pytest.mark.parametrize("channels", [1, 8, 9, 24, 51])
def test_baked_weights_are_the_rasterizer(channels):
    """W · lights is the image to the bit, Wᵀ · d_image the gradient; borders and padding included.

    51 channels do not fit the registers at once; 70 Gaussians in a tile are more than one chunk.
    """
    device, camera = open_device(), camera_at_origin(37, 22)
    scene = random_scene(300, channels, camera=camera)
    out, gradients, upstream = run_engine(device, camera, RasterConfig(channels), scene)
    view, shape = bake(device, out), (22, 37, channels)
    image, d_image = (padded_zeros(device, 37 * 22, shape) for _ in range(2))
    image.fill(np.float32(np.nan))
    view.render(padded(device, scene.colors.astype(np.float32)), image)
    np.testing.assert_array_equal(image.get(), out.image.get())
    d_image.set(upstream[0])
    gathered = device.empty((300, channels))
    gathered.fill(np.float32(np.nan))
    view.gather(d_image, gathered)
    expected = gradients.colors.get()
    assert relative(gathered.get(), expected) < 1e-6
    np.testing.assert_array_equal(view.visible.get() > 0, (expected != 0).any(axis=1))
    halved = view.halved()
    halved.render(padded(device, scene.colors.astype(np.float32)), image)
    assert 0 < relative(image.get(), out.image.get()) < 3e-4  # half keeps 11 bits of a weight
    assert halved.nbytes < view.nbytes
    # The size is known before the view is made.
    assert bake_within(device, out, view.nbytes - 1) is None
    within = bake_within(device, out, view.nbytes)
    assert within is not None
    assert within.nbytes == view.nbytes


def test_baked_view_without_gaussians_is_black():
    device, camera = open_device(), camera_at_origin(16, 16)
    scene = random_scene(3, 3, camera=camera)
    away = scene.replaced(means=-scene.means)
    out, _, _ = run_engine(device, camera, RasterConfig(), away)
    view = bake(device, out)
    image, d_lights = padded_zeros(device, 256, (16, 16, 3)), device.empty((3, 3))
    view.render(padded(device, np.ones((3, 3), np.float32)), image)
    view.gather(image, d_lights)
    assert not image.get().any()
    assert not d_lights.get().any()
    assert not view.visible.get().any()
