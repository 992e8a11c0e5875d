"""A drawn room with glowing lamps, a window, white objects, and cameras that look at it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from luxcore.cameras import Camera, look_at
from luxcore.capture import Capture, Points, View, write_capture
from luxcore.capture.depth_points import pixel_rays
from luxcore.light.agx import agx

WARM = np.array([1.0, 0.75, 0.45])
DAYLIGHT = np.array([0.85, 0.95, 1.1])


@dataclass(frozen=True)
class Globe:
    """A glowing ball; it lights what is around it."""

    place: tuple[float, float, float]
    radius: float = 0.12
    radiance: float = 60.0


@dataclass(frozen=True)
class DrawnRoom:
    """A box 6 x 4 x 2.8 m with its origin in the middle of the floor, walls of plain paint."""

    globes: tuple[Globe, ...]
    window: bool = True
    post: bool = False
    """A dark post near x = 1.2 that hides part of what is behind it."""

    def draw(self, camera: Camera) -> tuple[np.ndarray, list[np.ndarray]]:
        """Display photo [h, w, 3] and the true mask of every globe."""
        rows, columns = np.mgrid[0 : camera.height, 0 : camera.width]
        rays = pixel_rays(camera, columns + 0.5, rows + 0.5)
        distance, light = self._walls(camera.centre, rays)
        masks = []
        for globe in self.globes:
            reach = _ball(camera.centre, rays, globe)
            masks.append(reach < distance)
            light[masks[-1]] = globe.radiance * WARM
            distance = np.minimum(distance, reach)
        if self.post:
            hidden = _post(camera.centre, rays) < distance
            light[hidden] = 0.02
            masks = [m & ~hidden for m in masks]
        return agx(light.astype(np.float32)), masks

    def _walls(self, origin: np.ndarray, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        half = np.array([3.0, 2.0, 1.4])
        start = origin - [0, 0, 1.4]
        with np.errstate(divide="ignore"):
            reach = (np.sign(rays) * half - start) / rays
        distance = reach.min(axis=-1)
        spot = start + rays * distance[..., None]
        tint = 0.6 + 0.25 * np.sin(7 * spot[..., 0]) * np.sin(9 * spot[..., 1] + spot[..., 2])
        light = 0.05 * tint[..., None] * DAYLIGHT
        for globe in self.globes:
            gap = np.linalg.norm(spot - (np.array(globe.place) - [0, 0, 1.4]), axis=-1)
            falloff = globe.radiance * globe.radius**2 / (gap**2 + 0.05)
            light = light + 0.15 * (tint * falloff)[..., None] * WARM
        opening = (spot[..., 1] > 1.99) & (np.abs(spot[..., 0]) < 1) & (np.abs(spot[..., 2]) < 0.6)
        if self.window:
            light[opening] = 12 * DAYLIGHT
        return distance, light


def _ball(origin: np.ndarray, rays: np.ndarray, globe: Globe) -> np.ndarray:
    to = np.array(globe.place) - origin
    along = rays @ to
    gap2 = (to @ to) - along**2
    inside = globe.radius**2 - gap2
    return np.where((inside > 0) & (along > 0), along - np.sqrt(np.maximum(inside, 0)), np.inf)


def _post(origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Distance to a vertical post of 3 cm radius at (1.2, 0.0)."""
    flat = rays[..., :2]
    to = np.array([1.2, 0.0]) - origin[:2]
    along = (flat @ to) / (flat**2).sum(-1)
    gap = np.linalg.norm(flat * along[..., None] - to, axis=-1)
    return np.where((gap < 0.03) & (along > 0), along, np.inf)


def draw_capture(folder: Path, room: DrawnRoom, cameras: Sequence[Camera]) -> Capture:
    """A capture of drawn photos, without truth."""
    views = [View(f"{i:04d}.png", room.draw(c)[0], c) for i, c in enumerate(cameras)]
    points = Points(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint8))
    return write_capture(folder, "drawn", views, points, source="photos", metric=False)


@pytest.fixture(scope="session")
def row_of_cameras() -> list[Camera]:
    """Six cameras side by side that look along +x."""
    eyes = [np.array([-2.4, -1.2 + 0.45 * i, 1.4 + 0.05 * (i % 2)]) for i in range(6)]
    return [look_at(eye, np.array([3.0, 0.2, 1.3]), 66.0, 320, 240) for eye in eyes]
