"""Plücker rays: lines, wherever the room lies and however many cameras there are."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from luxcore.cameras import Camera, look_at
from luxcore.models.multiview_unet.rays import plucker_rays


def _cameras(offset: np.ndarray) -> list[Camera]:
    eyes = [np.array([0.0, 0, 1.5]), np.array([1.0, 0.2, 1.4]), np.array([0.3, 1.1, 1.6])]
    return [look_at(offset + eye, offset + np.array([3.0, 3, 1]), 70.0, 64, 48) for eye in eyes]


def test_plucker_rays_are_lines() -> None:
    rays = plucker_rays(_cameras(np.zeros(3)), 6, 8).numpy()
    directions, moments = rays[:, :3], rays[:, 3:]
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-6)
    np.testing.assert_allclose((directions * moments).sum(1), 0, atol=1e-6)
    assert np.linalg.norm(moments, axis=1).max() <= 1 + 1e-6
    assert not moments[0].any()  # the first camera is the origin


def test_plucker_rays_of_one_point_meet_there() -> None:
    """moment = point × direction holds for any point of the line, in the first camera's frame."""
    cameras = _cameras(np.zeros(3))
    first = cameras[0]
    unit = max(np.linalg.norm(c.centre - first.centre) for c in cameras)
    rays = plucker_rays(cameras, 48, 64).numpy()
    world = np.array([2.0, 1.5, 1.2])
    point = first.c2w[:3, :3].T @ (world - first.centre) / unit
    for camera, ray in zip(cameras, rays, strict=True):
        local = camera.viewmat[:3, :3] @ world + camera.viewmat[:3, 3]
        u = local[0] / local[2] * camera.fx + camera.cx
        v = local[1] / local[2] * camera.fy + camera.cy
        direction, moment = np.split(ray[:, int(v), int(u)], 2)
        # The nearest pixel centre is up to half a pixel away.
        assert (
            np.linalg.norm(np.cross(point, direction) - moment)
            < 1.5 * np.linalg.norm(point) / camera.fx
        )


@pytest.mark.parametrize("distance_m", [0.0, 1e6])
def test_plucker_rays_do_not_depend_on_where_the_room_lies(distance_m: float) -> None:
    """At 1e6 m float64 positions keep 1e-10 m; relative to a metre that leaves float32 exact."""
    near = plucker_rays(_cameras(np.zeros(3)), 6, 8)
    far = plucker_rays(_cameras(np.array([distance_m, -distance_m, distance_m])), 6, 8)
    assert torch.isfinite(far).all()
    torch.testing.assert_close(far, near, rtol=0, atol=1e-6)


def test_plucker_rays_of_equal_cameras_and_of_one() -> None:
    camera = _cameras(np.zeros(3))[1]
    one = plucker_rays([camera], 6, 8)
    two = plucker_rays([camera, camera], 6, 8)
    assert torch.equal(two[0], two[1])
    assert torch.equal(two[0], one[0])
    assert not one[:, 3:].any()
