"""A small synthetic room for the tests of fitting: textured Gaussians on the walls of a box.

Its photos and its light images are rendered with the rasterizer itself, so that a perfect fit
exists and its quality has a known ceiling.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from luxcore.cameras import Camera, look_at
from luxcore.capture import Capture, Points, View, write_capture
from luxcore.files.atomic import write_json
from luxcore.files.exr import write_exr
from luxcore.light.agx import agx
from luxcore.splats.device import open_device
from luxcore.splats.gaussians import Gaussians, sh_from_color
from luxcore.splats.light_views import light_names
from luxcore.splats.rasterizer import RasterConfig, Rasterizer

HALF = np.array([2.0, 1.5, 1.2])
"""Half the size of the room, metres."""


@dataclass(frozen=True)
class Room:
    """Gaussians on the walls, their albedo, and the irradiance of each light on each of them."""

    gaussians: Gaussians
    albedo: np.ndarray  # [n, 3]
    lights: np.ndarray  # [n, m, 3] linear radiance, ambient first


def make_room(n: int = 3000, lamps: int = 2, seed: int = 0) -> Room:
    """A box with checkered walls, an even ambient and point lamps near its ceiling."""
    random = np.random.default_rng(seed)
    axis, side = random.integers(3, size=n), random.choice([-1.0, 1.0], n)
    means = random.uniform(-1, 1, (n, 3)) * HALF
    means[np.arange(n), axis] = side * HALF[axis]
    normals = np.zeros((n, 3))
    normals[np.arange(n), axis] = -side
    checks = np.floor(means * 1.5 + 0.25).sum(1) % 2
    tint = 0.5 + 0.35 * np.sin(means * [1.3, 2.1, 1.7] + [0, 1, 2])
    albedo = (0.25 + 0.6 * checks[:, None]) * tint
    light = [np.full((n, 3), 0.25)]
    for _ in range(lamps):
        position = random.uniform(-0.6, 0.6, 3) * HALF
        position[2] = 0.6 * HALF[2]
        towards = position - means
        distance2 = (towards**2).sum(1)
        cosine = np.maximum((towards * normals).sum(1), 0) / np.sqrt(distance2)
        light.append((cosine / (distance2 + 0.05))[:, None] * random.uniform(0.5, 1.0, 3))
    area = 8 * (HALF[0] * HALF[1] + HALF[1] * HALF[2] + HALF[0] * HALF[2])
    scale = np.log(0.8 * np.sqrt(area / n))
    gaussians = Gaussians(
        means.astype(np.float32),
        random.normal(size=(n, 4)).astype(np.float32),
        np.full((n, 3), scale, np.float32),
        np.full(n, 3.0, np.float32),
        sh_from_color(albedo.astype(np.float32)),
    )
    lights = (albedo[:, None] * np.stack(light, 1)).astype(np.float32)
    return Room(gaussians, albedo.astype(np.float32), lights)


def room_cameras(count: int, width: int, height: int) -> list[Camera]:
    """On a small circle in the middle, looking outwards across the room."""
    cameras = []
    for angle in np.linspace(0, 2 * np.pi, count, endpoint=False):
        eye = np.array([0.7 * np.cos(angle), 0.5 * np.sin(angle), 0.1 * np.sin(3 * angle)])
        target = -2 * eye + [0, 0, 0.1]
        cameras.append(look_at(eye, target, 75.0, width, height))
    return cameras


def render_colors(room: Room, camera: Camera, colors: np.ndarray) -> np.ndarray:
    """[h, w, c] image of per-Gaussian colours [n, c]."""
    device, g = open_device(), room.gaussians
    rasterizer = Rasterizer(device, RasterConfig(channels=colors.shape[1]))
    arrays = (g.means, g.quats, g.log_scales, g.opacity_logits, colors.astype(np.float32))
    return rasterizer.forward(camera, *(device.array(a) for a in arrays)).image.get()


def write_room_capture(
    folder: Path, room: Room, views: int = 9, width: int = 64, height: int = 48
) -> Capture:
    """Photos under all lights, and noisy points of the walls."""
    total = room.lights.sum(1)
    cameras = room_cameras(views, width, height)
    shots = [
        View(f"{i}.png", agx(render_colors(room, c, total)).astype(np.float32), c)
        for i, c in enumerate(cameras)
    ]
    random = np.random.default_rng(5)
    chosen = random.permutation(len(total))[: len(total) // 3]
    xyz = room.gaussians.means[chosen] + random.normal(size=(len(chosen), 3)) * 0.01
    rgb = np.round(255 * agx(total[chosen])).astype(np.uint8)
    points = Points(xyz.astype(np.float32), rgb)
    return write_capture(folder, "box", shots, points, source="synthetic", metric=True)


def write_light_inputs(
    folder: Path, room: Room, capture: Capture, on: tuple[bool, ...] = (True, True)
) -> tuple[Path, Path]:
    """(fuse folder, masks folder) as the stages before would leave them, from the truth."""
    fuse, masks = folder / "fuse", folder / "masks"
    n, lights, _ = room.lights.shape
    for index, frame in enumerate(capture.frames):
        image = render_colors(room, frame.camera, room.lights.reshape(n, -1))
        layers = {
            name: image[..., 3 * m : 3 * m + 3] for m, name in enumerate(light_names(lights - 1))
        }
        write_exr(fuse / f"{index:04d}.exr", layers, half=False)
    write_json(fuse / "fuse.json", {"method": "truth", "exposure": 1.0, "clipped": 0})
    lamps = [
        {"index": i, "name": f"lamp_{i}", "on": on[i], "references": [], "areas": {}}
        for i in range(lights - 1)
    ]
    write_json(masks / "lamps.json", lamps)
    return fuse, masks
