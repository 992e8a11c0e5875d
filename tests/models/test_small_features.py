"""What the network is told: in camera axes, finite, and right where it can be checked by hand."""

from __future__ import annotations

import numpy as np
import torch

from luxcore.cameras import Camera, look_at
from luxcore.models.small.features import MV_CHANNELS, SV_CHANNELS, lamp_features
from luxcore.models.small.hints import KnownLight, references_of
from luxcore.models.small.multiview import (
    TargetView,
    correspondence,
    multiview_features,
    pluecker,
)
from luxcore.models.small.surfaces import Surfaces, lambert_terms, lamp_centres, surfaces_of


def wall(camera: Camera, distance_m: float = 2.0) -> Surfaces:
    """A wall parallel to the picture."""
    depth = np.full((camera.height, camera.width), distance_m, np.float32)
    normal = np.broadcast_to(-camera.c2w[:3, 2], (*depth.shape, 3)).astype(np.float32)
    return surfaces_of(depth, normal, camera)


def camera(yaw_deg: float = 0, eye: tuple[float, float, float] = (0, 0, 1)) -> Camera:
    angle = np.radians(yaw_deg)
    target = np.add(eye, [np.cos(angle), np.sin(angle), 0.0])
    return look_at(np.array(eye, float), target, 60.0, 32, 32)


def test_normals_face_the_camera_whatever_way_it_looks() -> None:
    for yaw in (0, 70, 200):
        normals = wall(camera(yaw)).normals
        torch.testing.assert_close(normals[2], torch.full((32, 32), -1.0))


def test_unknown_depth_and_normals_are_told_as_unknown() -> None:
    depth = np.full((32, 32), np.nan, np.float32)
    depth[16:] = 2.0
    normal = np.zeros((32, 32, 3), np.float32)
    normal[:, :16] = [-1, 0, 0]
    surfaces = surfaces_of(depth, normal, camera())
    assert surfaces.valid[16:, :16].all()
    assert not surfaces.valid[:16].any()
    assert not surfaces.valid[:, 16:].any()
    assert torch.isfinite(surfaces.points).all()


def test_lambert_terms_of_a_lamp_before_a_wall() -> None:
    surfaces = wall(camera(), 2.0)
    direction, distance, irradiance = lambert_terms(surfaces, torch.tensor([0.0, 0.0, 1.0]))
    middle = (16, 16)
    assert abs(float(distance[middle]) - 1) < 1e-2
    assert abs(float(irradiance[middle]) - 1) < 2e-2
    assert float(direction[2][middle]) < -0.99
    assert (irradiance <= irradiance[middle] + 1e-3).all()


def test_a_lamps_centre_is_where_its_mask_has_depth() -> None:
    masks = torch.zeros(2, 32, 32)
    masks[0, 15:17, 15:17] = 1
    dark, off = torch.zeros(3, 32, 32), torch.zeros(2, dtype=torch.bool)
    centres, known = lamp_centres(masks, wall(camera(), 3.0), dark, off)
    torch.testing.assert_close(centres[0], torch.tensor([0.0, 0.0, 3.0]), atol=1e-5, rtol=0)
    assert known.tolist() == [True, False]


def test_a_burning_lamp_shines_from_what_glows_in_its_mask() -> None:
    masks, photo = torch.zeros(1, 32, 32), torch.full((3, 32, 32), 0.1)
    masks[0, 4:28, 15:17] = 1
    photo[:, 4:8, 15:17] = 10
    surfaces = wall(camera(), 3.0)
    lit, _ = lamp_centres(masks, surfaces, photo, torch.tensor([True]))
    unlit, _ = lamp_centres(masks, surfaces, photo, torch.tensor([False]))
    torch.testing.assert_close(lit[0], surfaces.points[:, 4:8, 15:17].mean((1, 2)))
    torch.testing.assert_close(unlit[0], surfaces.points[:, 4:28, 15:17].mean((1, 2)))


def test_features_are_finite_for_black_photos_empty_masks_and_no_geometry() -> None:
    masks = torch.zeros(3, 32, 32)
    masks[0, 3, 4] = 1
    masks[1] = 1
    on = torch.tensor([True, False, True])
    for surfaces in (None, wall(camera())):
        features = lamp_features(torch.zeros(3, 32, 32), masks, on, surfaces)
        assert features.shape == (3, SV_CHANNELS, 32, 32)
        assert torch.isfinite(features).all()


def test_two_views_of_one_wall_correspond_where_they_should() -> None:
    first, second = camera(), camera(eye=(0, -0.5, 1))
    here, there = wall(first), wall(second)
    grid, weight = correspondence(here, first, there, second)
    # y points left, so a camera half a metre to the right sees everything further left.
    shift_px = second.fx * 0.5 / 2.0
    u = (grid[0, 16, :, 0] + 1) / 2 * 32 - 0.5
    expected = torch.arange(32) - shift_px
    torch.testing.assert_close(u, expected.float(), atol=1e-3, rtol=0)
    inside = (expected > 0) & (expected < 31)
    assert (weight[16][inside] > 0).all()
    assert (weight[16][expected < -1] == 0).all()


def test_what_another_surface_hides_does_not_correspond() -> None:
    first = camera()
    grid, weight = correspondence(wall(first, 2.0), first, wall(first, 1.0), first)
    assert (weight == 0).all()
    assert torch.isfinite(grid).all()


def test_rays_are_finite_at_the_origin_and_a_million_metres_away() -> None:
    base = camera(eye=(0, 0, 0))
    for eye in ((0, 0, 0), (1e6, 0, 0)):
        rays = pluecker(camera(eye=eye), base)
        assert rays.shape == (6, 32, 32)
        assert torch.isfinite(rays).all()
        assert rays.abs().max() <= 1 + 1e-6
    assert pluecker(base, base)[3:].abs().max() == 0


def test_a_reference_in_the_same_place_hands_its_fractions_over_unchanged() -> None:
    place, surfaces = camera(), wall(camera())
    photo = torch.full((3, 32, 32), 1.0)
    masks = torch.zeros(2, 32, 32)
    masks[0, 10:12, 10:12] = 1
    on = torch.tensor([True, True])
    lights = torch.stack([0.25 * (photo + 0.02), 0.5 * (photo + 0.02)])
    known = torch.tensor([True, False])
    reference = KnownLight(place, photo, masks, on, surfaces, lights, known)
    features, warped = multiview_features(
        TargetView(photo, masks, on, surfaces), place, references_of([reference], 2)
    )
    assert features.shape == (2, MV_CHANNELS, 32, 32)
    torch.testing.assert_close(warped.ratio[0], torch.full((3, 32, 32), 0.25))
    assert (warped.known[0] == 1).all()
    assert (warped.known[1] == 0).all()
