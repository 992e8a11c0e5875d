"""Undistortion, uprightness, pose error and points from depth: against exact constructions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from luxcore.cameras import Camera, look_at
from luxcore.capture.depth_points import points_from_distance
from luxcore.capture.orientation import room_like, upright
from luxcore.capture.pose_error import rotation_angle_deg, umeyama
from luxcore.capture.sparse import Lens
from luxcore.capture.undistort import scaled, undistort


def test_undistorted_lines_are_straight_and_in_place() -> None:
    """A photo whose value is its ideal x coordinate must, undistorted, be linear in x."""
    lens = Lens(160, 120, 110.0, 112.0, 79.0, 61.5, (-0.18, 0.05, 0.002, -0.001))
    k1, k2, p1, p2 = lens.distortion
    v, u = np.mgrid[0:120, 0:160] + 0.5
    xd, yd = (u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy
    x, y = xd.copy(), yd.copy()
    for _ in range(60):  # fixed point of the distortion model gives the ideal ray of each pixel
        r2 = x * x + y * y
        radial = 1 + k1 * r2 + k2 * r2 * r2
        x = (xd - 2 * p1 * x * y - p2 * (r2 + 2 * x * x)) / radial
        y = (yd - p1 * (r2 + 2 * y * y) - 2 * p2 * x * y) / radial
    photo = np.stack([x, y, np.zeros_like(x)], -1).astype(np.float32)
    flat, pinhole = undistort("a.png", photo, lens)
    assert not pinhole.distorted
    expected_x = (u - pinhole.cx) / pinhole.fx
    expected_y = (v - pinhole.cy) / pinhole.fy
    # Bilinear resampling in 1/32 pixel steps: 0.05 px is 5e-4 in ray units.
    assert np.abs(flat[..., 0] - expected_x).max() < 5e-4
    assert np.abs(flat[..., 1] - expected_y).max() < 5e-4


def test_scaling_a_lens_keeps_its_rays() -> None:
    lens = Lens(160, 120, 110.0, 112.0, 79.0, 61.5, (0.1, 0.0, 0.0, 0.0))
    half = scaled(lens, 80, 60)
    assert (40 - half.cx) / half.fx == pytest.approx((80 - lens.cx) / lens.fx)
    assert half.distortion == lens.distortion


def _looking_around(pitch: float) -> np.ndarray:
    eyes = np.array([[0, 0, 1.5], [0.4, 0.1, 1.5], [0.2, 0.5, 1.6], [-0.3, 0.2, 1.4]])
    ahead = np.array([[1, 0, pitch], [0, 1, pitch], [-1, 0.2, pitch], [0.3, -1, pitch]])
    return np.stack(
        [look_at(e, t, 60.0, 8, 6).c2w for e, t in zip(eyes, eyes + ahead, strict=True)]
    )


@pytest.mark.parametrize("pitch", [0.0, -0.7, 0.5])
def test_up_is_found_whatever_the_pitch(pitch: float) -> None:
    """Cameras that turn show which way is up, although their mean up axis is tilted."""
    turned = np.eye(4)
    turned[:3, :3] = Rotation.from_euler("xyz", [50, -20, 30], degrees=True).as_matrix()
    rotation = upright(turned @ _looking_around(pitch))
    # A tenth of a degree: the weight of the mean up axis; the mean alone is off by 4 degrees.
    assert rotation @ turned[:3, :3] @ [0, 0, 1] == pytest.approx([0, 0, 1], abs=1.8e-3)
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1)


def test_cameras_that_do_not_turn_use_their_mean_up() -> None:
    eyes = [np.array([0, 0.2 * i, 1.0]) for i in range(4)]
    c2w = np.stack([look_at(e, e + np.array([1.0, 0, 0]), 60.0, 8, 6).c2w for e in eyes])
    assert upright(c2w) == pytest.approx(np.eye(3), abs=1e-9)


def test_room_like_scale_and_height() -> None:
    c2w = _looking_around(0.0)
    c2w[:, :3, 3] *= 7
    xyz = np.random.Generator(np.random.PCG64(0)).normal(size=(500, 3)) * 20
    world = room_like(c2w, xyz)
    moved = np.stack([world.pose(p) for p in c2w])
    assert moved[:, 2, 3].mean() == pytest.approx(1.5)
    points = world.points(xyz)
    depth = [(points - p[:3, 3]) @ p[:3, 2] for p in moved]
    front = np.concatenate([d[d > 0] for d in depth])
    assert np.median(front) == pytest.approx(3.0, rel=1e-9)


def test_room_like_without_points() -> None:
    world = room_like(_looking_around(0.0), np.zeros((0, 3)))
    assert np.isfinite(world.scale)
    assert world.scale > 0


def test_umeyama_undoes_a_similarity_and_refuses_mirrors() -> None:
    rng = np.random.Generator(np.random.PCG64(5))
    source = rng.normal(size=(9, 3))
    rotation = Rotation.from_euler("xyz", [10, 70, -40], degrees=True).as_matrix()
    target = 2.5 * source @ rotation.T + [1, -2, 3]
    fit = umeyama(source, target)
    assert fit.points(source) == pytest.approx(target, abs=1e-9)
    mirrored = umeyama(source, source * [1, 1, -1])
    assert np.linalg.det(mirrored.rotation) == pytest.approx(1)


@pytest.mark.parametrize("degrees", [0.0, 1e-5, 0.3, 90.0, 180.0])
def test_rotation_angles_are_exact(degrees: float) -> None:
    b = Rotation.from_rotvec(np.radians(degrees) * np.array([0.6, 0, 0.8])).as_matrix()
    angle = rotation_angle_deg(np.eye(3)[None], b[None])[0]
    assert angle == pytest.approx(degrees, rel=1e-6, abs=1e-9)


def test_points_from_distance_lie_on_the_walls(box_room, ring_cameras: list[Camera]) -> None:
    photo, distance = box_room.photo(ring_cameras[2])
    distance = distance.copy()
    distance[:10] = 0
    points = points_from_distance(distance, photo, ring_cameras[2], 900)
    assert 400 < len(points.xyz) <= 1000
    off_wall = np.abs(np.abs(points.xyz - [0, 0, 1.4]) / [2.5, 2.0, 1.4] - 1).min(axis=1)
    assert off_wall.max() < 1e-5
