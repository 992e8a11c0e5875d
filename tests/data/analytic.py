"""A box room whose light is known in closed form, so that samplers can be checked exactly."""

from __future__ import annotations

import numpy as np

from luxcore.cameras import Camera
from luxcore.data.compact import Lamp, RenderedView
from luxcore.data.panorama import directions_of_pixels

LOW, HIGH = np.array([0.0, 0.0, 0.0]), np.array([6.0, 5.0, 2.8])
LAMPS = np.array([[1.0, 1.0, 1.6], [4.8, 4.2, 2.2], [3.0, 2.5, 2.5]])
RADIUS_M = 0.25
SCALE = (2.0, 1.8, 1.5)
AMBIENT = np.array([0.10, 0.12, 0.15])


def hit_box(origin: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance [...] and inward normal [..., 3] of the wall that each ray meets."""
    with np.errstate(divide="ignore"):
        walls = np.where(directions > 0, HIGH - origin, LOW - origin) / directions
    axis = walls.argmin(-1)
    normal = -np.sign(directions) * np.eye(3)[axis]
    return walls.min(-1), normal


def light_at(points: np.ndarray, normal: np.ndarray, lamp: int) -> np.ndarray:
    """Lambert's law for a point lamp at unit white, with a wall pattern as albedo. [..., 3]"""
    to_lamp = LAMPS[lamp] - points
    square = (to_lamp**2).sum(-1)
    cosine = np.maximum((to_lamp * normal).sum(-1) / np.sqrt(square), 0)
    return (albedo_at(points) * (cosine / square)[..., None]).astype(np.float32)


def albedo_at(points: np.ndarray) -> np.ndarray:
    """A slow pattern over the walls. [..., 3]"""
    return 0.5 + 0.3 * np.sin(
        points @ np.array([[1.0, 0.4, 0.2], [0.3, 1.1, 0.5], [0.2, 0.6, 1.3]])
    )


def lamp_mask(origin: np.ndarray, directions: np.ndarray, lamp: int) -> np.ndarray:
    """Pixels within RADIUS_M of the lamp's centre, as seen from `origin`. [...] bool"""
    to_lamp = LAMPS[lamp] - origin
    along = directions @ to_lamp
    beside = (to_lamp**2).sum() - along**2
    return (along > 0) & (beside < RADIUS_M**2)


def rendered(
    origin: np.ndarray,
    directions: np.ndarray,
    *,
    room: str = "box",
    camera: Camera | None = None,
    lamps: int = 3,
    on: tuple[bool, ...] = (True, True, False),
) -> RenderedView:
    """The view of the box along world `directions` [h, w, 3]."""
    distance, normal = hit_box(origin, directions)
    points = origin + distance[..., None] * directions
    c2w = np.eye(4)
    c2w[:3, 3] = origin
    masks = np.array([lamp_mask(origin, directions, i) for i in range(lamps)], bool)
    masks = masks.reshape(lamps, *distance.shape)
    lights = np.array([light_at(points, normal, i) for i in range(lamps)], np.float32)
    return RenderedView(
        room=room,
        kind="panorama" if camera is None else "perspective",
        c2w=c2w if camera is None else camera.c2w,
        camera=camera,
        ambient=(AMBIENT * albedo_at(points)).astype(np.float32),
        lights=lights.reshape(lamps, *distance.shape, 3),
        albedo=albedo_at(points).astype(np.float32),
        normal=normal.astype(np.float32),
        ray_distance_m=distance.astype(np.float32),
        masks={kind: masks for kind in ("emitter", "fixture", "hull")},
        window=np.zeros(distance.shape, bool),
        lamps=tuple(
            Lamp(
                f"lamp_{i}", "floor", tuple(LAMPS[i]), 40.0, (1.0, 0.9, 0.8), on[i], (2.0, 1.8, 1.5)
            )
            for i in range(lamps)
        ),
        exposure=1.5,
        metadata={"seed": 7, "spp": 1},
    )


def panorama(
    origin: tuple[float, float, float] = (2.0, 2.2, 1.5), height: int = 64, **settings: object
) -> RenderedView:
    """An equirectangular view of the box."""
    return rendered(np.array(origin), directions_of_pixels(height, 2 * height), **settings)


def perspective(camera: Camera, **settings: object) -> RenderedView:
    """A pinhole view of the box."""
    v, u = np.mgrid[: camera.height, : camera.width] + 0.5
    local = np.stack(
        [(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], -1
    )
    directions = local @ camera.c2w[:3, :3].T
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    return rendered(camera.centre, directions, camera=camera, **settings)
