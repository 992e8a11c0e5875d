"""Choosing a device, and what the rasterizer refuses."""

from __future__ import annotations

import numpy as np
import pytest
from engine_scenes import camera_at_origin, on_device, random_scene

from luxcore.errors import DeviceError
from luxcore.splats.device import define_text, open_device
from luxcore.splats.rasterizer import RasterConfig, Rasterizer


def test_a_platform_is_chosen_by_name_and_version(monkeypatch):
    device = open_device("portable computing language")
    assert device.description.startswith("Portable Computing Language")
    monkeypatch.setenv("LUX_OPENCL_PLATFORM", "no such vendor")
    with pytest.raises(DeviceError, match=r"'no such vendor'; found \['Portable"):
        open_device()


def test_a_kernel_that_does_not_build_is_named():
    with pytest.raises(DeviceError, match=r"kernel projection\.cl"):
        open_device().program("projection", {"LANES": "broken("})
    with pytest.raises(DeviceError, match=r"kernel absent\.cl"):
        open_device().program("absent")


def test_an_array_that_the_device_cannot_hold_is_one_sentence():
    with pytest.raises(DeviceError, match=r"cannot hold an array of 400000\.00 GB"):
        open_device().empty((10**14,))


def test_constants_reach_kernels_with_all_their_digits():
    assert define_text(1 / 255) == "0.003921568859368563f"
    assert float(np.float32(0.003921568859368563)) == float(np.float32(1 / 255))
    assert define_text(True) == "1"


def test_wrong_shapes_and_types_are_named():
    device = open_device()
    rasterizer = Rasterizer(device, RasterConfig(channels=4))
    arrays = on_device(device, random_scene(5))
    with pytest.raises(ValueError, match=r"colors must be float32 of shape \(5, 4\)"):
        rasterizer.forward(camera_at_origin(), *arrays)
    arrays = on_device(device, random_scene(5, 4))
    arrays[1] = device.array(np.zeros((5, 4)))
    with pytest.raises(ValueError, match=r"quats must be float32 .* got float64"):
        rasterizer.forward(camera_at_origin(), *arrays)


def test_a_configuration_without_channels_is_refused():
    with pytest.raises(ValueError, match="channels must be at least 1"):
        RasterConfig(channels=0)
