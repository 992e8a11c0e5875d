"""Frozen geometry: recolouring and colour gradients give what the full passes give."""

from __future__ import annotations

import numpy as np
import pytest
from engine_scenes import camera_at_origin, on_device, random_scene, relative, run_engine

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
