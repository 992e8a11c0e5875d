"""Cutting photos out of panoramas: against the closed form, across the seam, over the poles."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from luxcore.data.panorama import (
    depth_from_distance,
    directions_of_pixels,
    pixel_directions,
    sample_perspective,
    view_rotation,
)
from luxcore.errors import InputError


def smooth_field(directions: np.ndarray) -> np.ndarray:
    """A function on the sphere with no seam and no pole. [..., 3]"""
    x, y, z = np.moveaxis(np.asarray(directions), -1, 0)
    return np.stack([1 + 0.5 * x + 0.3 * y * z, 0.8 + 0.4 * z - 0.2 * x * y, 1.2 - 0.5 * y], -1)


def sampled_error(rotation: np.ndarray, rows: int = 128, fov: float = 80.0) -> float:
    panorama = torch.from_numpy(smooth_field(directions_of_pixels(rows, 2 * rows))).float()
    photo = sample_perspective(panorama, rotation, fov, 48, 40)
    rays = pixel_directions(fov, 48, 40).numpy() @ rotation.T
    return float(np.abs(photo.numpy() - smooth_field(rays)).max())


@pytest.mark.parametrize(
    ("azimuth", "elevation"),
    [(0.0, 0.0), (180.0, 0.0), (-179.3, 10.0), (35.0, 90.0), (35.0, -90.0), (90.0, 89.9)],
)
def test_photo_equals_the_field_at_seam_and_poles(azimuth, elevation):
    # Bilinear interpolation of this field is off by its curvature times (pi/128)²/8.
    assert sampled_error(view_rotation(azimuth, elevation)) < 5e-4


@settings(max_examples=30, deadline=None)
@given(st.floats(-180, 180), st.floats(-90, 90), st.floats(-30, 30), st.floats(20, 140))
def test_photo_equals_the_field_anywhere(azimuth, elevation, roll, fov):
    assert sampled_error(view_rotation(azimuth, elevation, roll), fov=fov) < 5e-4


def test_seam_is_exact_for_a_field_that_jumps_elsewhere():
    rows = 32
    panorama = torch.zeros(rows, 2 * rows, 1)
    panorama[:, rows:] = 1.0
    shifted = panorama.roll(rows, 1)
    ahead = sample_perspective(panorama, view_rotation(0.0, 0.0), 60.0, 31, 31)
    behind = sample_perspective(shifted, view_rotation(180.0, 0.0), 60.0, 31, 31)
    assert torch.allclose(ahead, behind, atol=1e-4)


def test_axes_are_those_of_the_conventions():
    up, left = view_rotation(0.0, 90.0)[:, 2], view_rotation(90.0, 0.0)[:, 2]
    front = view_rotation(0.0, 0.0)[:, 2]
    assert np.allclose(up, [0, 0, 1])
    assert np.allclose(left, [0, 1, 0])
    assert np.allclose(front, [1, 0, 0])
    assert np.allclose(view_rotation(0.0, 0.0)[:, 1], [0, 0, -1])
    rotation = view_rotation(30.0, 20.0, 10.0)
    assert np.allclose(rotation @ rotation.T, np.eye(3))
    assert np.linalg.det(rotation) == pytest.approx(1)


def test_panorama_centre_and_left_edge():
    directions = directions_of_pixels(64, 128)
    assert np.allclose(directions[32, 64], [1, 0, 0], atol=0.04)
    assert directions[32, 0, 1] > 0
    assert directions[32, 0, 0] < -0.99
    assert directions[0, 0, 2] > 0.99


def test_nearest_makes_no_new_values():
    panorama = torch.rand(16, 32, 1).round()
    photo = sample_perspective(panorama, view_rotation(170.0, 60.0), 100.0, 20, 20, nearest=True)
    assert set(photo.unique().tolist()) <= {0.0, 1.0}


def test_depth_of_a_wall_is_flat():
    rays = pixel_directions(90.0, 20, 10)
    distance = 2.0 / rays[..., 2]
    assert torch.allclose(depth_from_distance(distance, 90.0), torch.full((10, 20), 2.0))


def test_bad_arguments():
    with pytest.raises(InputError, match="field of view"):
        sample_perspective(torch.zeros(4, 8, 1), np.eye(3), 180.0, 4, 4)
    with pytest.raises(InputError, match="even width"):
        sample_perspective(torch.zeros(4, 7, 1), np.eye(3), 60.0, 4, 4)
