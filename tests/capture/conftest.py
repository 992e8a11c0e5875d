"""A small textured box of a room, seen by cameras whose poses are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from luxcore.cameras import Camera, look_at
from luxcore.capture.depth_points import pixel_rays

HALF = np.array([2.5, 2.0, 1.4])
"""Half extents of the box, metres; its floor is at z = 0."""


@dataclass(frozen=True)
class BoxRoom:
    """Exact photos of the inside of a box with noise painted on every wall."""

    textures: np.ndarray
    """[6, t, t, 3]"""

    def photo(self, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """(display [h, w, 3], ray distance [h, w]) by intersecting rays with the six walls."""
        rows, columns = np.mgrid[0 : camera.height, 0 : camera.width]
        rays = pixel_rays(camera, columns + 0.5, rows + 0.5)
        origin = camera.centre - [0, 0, HALF[2]]
        with np.errstate(divide="ignore"):
            reach = (np.sign(rays) * HALF - origin) / rays
        axis = reach.argmin(axis=-1)
        distance = np.take_along_axis(reach, axis[..., None], -1)[..., 0]
        spot = (origin + rays * distance[..., None]) / HALF
        side = axis * 2 + (np.take_along_axis(rays, axis[..., None], -1)[..., 0] > 0)
        others = np.array([[1, 2], [0, 2], [0, 1]])[axis]
        uv = np.take_along_axis(spot, others, -1)
        size = self.textures.shape[1] - 2
        place = np.clip((uv + 1) / 2, 0, 1) * size
        low = np.floor(place).astype(int)
        f = place - low
        photo = np.zeros((*distance.shape, 3))
        for dy in (0, 1):
            for dx in (0, 1):
                weight = np.where(dx, f[..., 0], 1 - f[..., 0]) * np.where(
                    dy, f[..., 1], 1 - f[..., 1]
                )
                photo += weight[..., None] * self.textures[side, low[..., 1] + dy, low[..., 0] + dx]
        return photo.astype(np.float32), distance


@pytest.fixture(scope="session")
def box_room() -> BoxRoom:
    """Textures with detail at several scales, so that SIFT finds plenty."""
    import cv2

    rng = np.random.Generator(np.random.PCG64(3))
    textures = []
    for _ in range(6):
        texture = np.zeros((256, 256, 3))
        for cells in (8, 20, 48, 100):
            noise = rng.uniform(-1, 1, (cells, cells, 3)).astype(np.float32)
            texture += cv2.resize(noise, (256, 256), interpolation=cv2.INTER_CUBIC)
        textures.append(np.clip(0.5 + 0.22 * texture, 0, 1))
    return BoxRoom(np.stack(textures))


@pytest.fixture(scope="session")
def ring_cameras() -> list[Camera]:
    """Eight cameras on an arc at eye height that look at one wall and turn with it."""
    cameras = []
    for index in range(8):
        eye = np.array([-1.6 + 0.05 * index, -0.9 + 0.26 * index, 1.3 + 0.06 * (index % 3)])
        cameras.append(look_at(eye, np.array([2.5, 0.35 * (index - 3.5), 1.2]), 68.0, 240, 180))
    return cameras
