"""Depth to normals, whether harmonics are earned, where a fit starts, and the order of views."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from luxcore.cameras import look_at
from luxcore.splats.backprojection import Backprojection
from luxcore.splats.geometry import camera_points, expected_depth, normals_from_depth
from luxcore.splats.harmonics_choice import choose_degree
from luxcore.splats.initial import initial_gaussians, random_points, scene_extent
from luxcore.splats.morton import morton_order
from luxcore.splats.views import resized, split_views, view_at

CAMERA = look_at(np.array([0.5, -3.0, 1.2]), np.array([0.2, 0.0, 0.9]), 70.0, 64, 48)


def test_normals_of_a_slanted_plane() -> None:
    """z of the plane n·x = d seen by each pixel gives back n, towards the camera, in world axes."""
    normal = np.array([0.3, -0.9, 0.2]) / np.linalg.norm([0.3, -0.9, 0.2])
    rays = camera_points(np.ones((48, 64), np.float32), CAMERA) @ CAMERA.c2w[:3, :3].T
    depth_m = (-(CAMERA.centre @ normal) / (rays @ normal)).astype(np.float32)
    found = normals_from_depth(depth_m, CAMERA)[4:-4, 4:-4]
    # Float32 depths of metres, differences of centimetres.
    np.testing.assert_allclose(found, np.broadcast_to(normal, found.shape), atol=2e-3)


def test_unknown_depth_is_zero_and_stays_finite() -> None:
    alpha = np.zeros((5, 7), np.float32)
    depth_m = expected_depth(np.ones((5, 7), np.float32), alpha)
    assert not depth_m.any()
    camera = CAMERA.resized(7, 5)
    assert np.isfinite(normals_from_depth(depth_m, camera)).all()
    one_pixel = CAMERA.resized(1, 1)
    assert np.isfinite(normals_from_depth(np.ones((1, 1), np.float32), one_pixel)).all()


def residuals(slope: float, noise: float) -> tuple[list[Backprojection], list[np.ndarray]]:
    random = np.random.default_rng(0)
    gaussians, found, directions = 200, [], []
    for _ in range(16):
        direction = random.normal(size=(gaussians, 3)).astype(np.float32)
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        color = slope * direction + noise * random.normal(size=(gaussians, 3))
        weights = random.uniform(0.5, 2, gaussians).astype(np.float32)
        found.append(Backprojection((color * weights[:, None]).astype(np.float32), weights))
        directions.append(direction)
    return found, directions


def test_harmonics_are_used_only_where_views_differ() -> None:
    """Judged on the views it was fitted to, degree 1 would always win: it has more parameters."""
    shiny, matte = choose_degree(*residuals(0.2, 0.1)), choose_degree(*residuals(0.0, 0.1))
    assert (shiny.degree, matte.degree) == (1, 0)
    assert shiny.gain > 0.2
    assert matte.gain < 0.01
    assert "does not earn" in matte.reason


def test_harmonics_of_one_view_are_not_asked_for() -> None:
    found, directions = residuals(0.2, 0.1)
    assert choose_degree(found[:1], directions[:1]).degree == 0


def test_start_survives_duplicates_and_lone_points() -> None:
    xyz = np.zeros((40, 3), np.float32)
    xyz[-1] = 1e3
    rgb = np.full((40, 3), 200, np.uint8)
    gaussians = initial_gaussians(xyz, rgb, 2.0, 100, np.random.default_rng(0))
    scale = np.exp(gaussians.log_scales)
    assert scale.min() >= 2e-4 * 0.999
    assert scale.max() <= 0.2 * 1.001


def test_one_camera_and_no_points_have_an_extent() -> None:
    assert scene_extent(np.zeros((0, 3), np.float32), [CAMERA]) == 1.0
    xyz, _ = random_points([CAMERA], 50, np.random.default_rng(0))
    seen = (xyz - CAMERA.centre) @ CAMERA.c2w[:3, :3]
    assert (seen[:, 2] > 0).all()


def test_views_are_split_and_visited_once_an_epoch() -> None:
    split = split_views(24, 8)
    assert split.held_out == (7, 15, 23)
    assert not set(split.held_out) & set(split.training)
    assert split_views(5, 8).held_out == ()
    order = [view_at(i, split.training, seed=0) for i in range(42)]
    assert sorted(order[:21]) == sorted(order[21:]) == list(split.training)
    assert order[:21] != order[21:]


def test_z_order_brings_neighbours_together() -> None:
    points = np.random.default_rng(0).random((4000, 3)).astype(np.float32)
    order = morton_order(points)
    assert sorted(order) == list(range(4000))
    step = np.linalg.norm(np.diff(points[order], axis=0), axis=1).mean()
    assert step < 0.25 * np.linalg.norm(np.diff(points, axis=0), axis=1).mean()
    assert len(morton_order(points[:0])) == 0
    assert list(morton_order(np.ones((3, 3), np.float32))) == [0, 1, 2]


def test_points_of_a_real_capture(shared_data: Path) -> None:
    """138,766 points with far outliers: a bounded start in a scene of a sensible size."""
    path = shared_data / "gsplat-garden" / "assets" / "test_garden.npz"
    if not path.is_file():
        pytest.skip("gsplat-garden is not among the data sets")
    data = np.load(path)
    xyz, rgb = data["means3d"], data["colors"]
    extent = scene_extent(xyz, [CAMERA])
    spread = np.linalg.norm(xyz - np.median(xyz, axis=0), axis=1)
    assert np.median(spread) < extent < spread.max()
    gaussians = initial_gaussians(xyz, rgb, extent, 20_000, np.random.default_rng(0))
    assert len(gaussians) == 20_000
    assert np.isfinite(gaussians.log_scales).all()


def test_light_images_of_any_number_of_lamps_are_averaged_to_any_size() -> None:
    rng = np.random.Generator(np.random.PCG64(0))
    image = rng.random((31, 47, 12), np.float32)
    camera = look_at(np.array([0.0, -1.0, 0.5]), np.zeros(3), 60.0, 29, 19)
    small = resized(image, camera)
    assert small.shape == (19, 29, 12)
    assert small.mean(axis=(0, 1)) == pytest.approx(image.mean(axis=(0, 1)), abs=0.01)
    np.testing.assert_array_equal(small[..., 3:6], resized(image[..., 3:6], camera))
