"""Rooms sketched in a second: boxes under soft-shadowed lamps with one bounce, for pretraining.

Path tracing gives the truth that the model is tuned and tested on; these sketches are cheap enough
for a thousand different rooms, so that the network has seen many rooms before it sees good ones.
Light is direct (shadow rays to points on each lamp) plus one bounce from virtual point lights.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import PCG64, Generator, SeedSequence

from luxcore.cameras import Camera, look_at
from luxcore.data.crops import LitCrop
from luxcore.data.lighting import exposed

SHADOW_POINTS = 6
BOUNCE_POINTS = 48


@dataclass(frozen=True)
class Lamp:
    """A glowing ball, or a disc where `flat`. `lobe`: how strongly its light favours `axis`."""

    centre: np.ndarray
    radius: float
    power: np.ndarray
    axis: np.ndarray
    lobe: float
    flat: bool = False


@dataclass(frozen=True)
class SketchRoom:
    """A box room [0, size] holding axis-aligned boxes; albedo and pattern per box face."""

    size: np.ndarray
    low: np.ndarray
    high: np.ndarray
    albedo: np.ndarray
    pattern: np.ndarray
    lamps: tuple[Lamp, ...]
    window: Lamp


class SketchRooms:
    """Photos of sketched rooms by number. Room r is seen by numbers r, r + rooms, …"""

    def __init__(self, rooms: int, size_px: int, seed: int) -> None:
        self.rooms, self.size_px, self.seed = rooms, size_px, seed

    def place(self, index: int) -> int:
        """The room of group `index`; nothing is read, so no order is cheaper than another."""
        return index % self.rooms

    def crops(self, index: int, views: int) -> list[LitCrop]:
        """`views` photos of one room under one light, turning around one of its lamps."""
        room = draw_room(_generator(self.seed, 0, self.place(index)))
        rng = _generator(self.seed, 1, index)
        on = rng.random(len(room.lamps)) < 0.75
        strength = np.exp(rng.normal(0, 0.6, len(room.lamps) + 1)).astype(np.float32)
        target = room.lamps[rng.integers(len(room.lamps))]
        eye = _place(room, rng)
        photos = []
        for _ in range(views):
            camera = _camera(room, eye, target, self.size_px, rng)
            photos.append(_photo(room, camera, on, strength))
            eye = np.clip(eye + rng.normal(0, 0.5, 3) * [1, 1, 0.3], 0.3, room.size - 0.3)
        return exposed(photos, rng)


def _generator(*entropy: int) -> Generator:
    return Generator(PCG64(SeedSequence(entropy)))


def draw_room(rng: Generator) -> SketchRoom:
    """A furnished room with 2 to 5 lamps and a window."""
    size = rng.uniform([3, 3, 2.4], [6, 6, 3.1]).astype(np.float32)
    count = int(rng.integers(5, 11))
    extent = rng.uniform([0.2, 0.2, 0.2], [1.5, 1.0, 1.2], (count, 3))
    extent[: count // 3, 2] = rng.uniform(1.2, 2.1, count // 3)
    corner = rng.uniform(0, 1, (count, 3)) * (size - extent) * [1, 1, 0]
    walls = rng.random(count) < 0.6
    side = rng.integers(0, 2, count)
    axis = rng.integers(0, 2, count)
    corner[walls, axis[walls]] = ((size - extent)[range(count), axis] * side)[walls]
    albedo = rng.uniform(0.08, 0.8, (count + 6, 1)) * (1 + rng.normal(0, 0.25, (count + 6, 3)))
    albedo[:5] = rng.uniform(0.45, 0.85) * (1 + rng.normal(0, 0.08, (5, 3)))
    lamps = tuple(_draw_lamp(size, corner, extent, rng) for _ in range(rng.integers(2, 6)))
    return SketchRoom(
        size,
        corner.astype(np.float32),
        (corner + extent).astype(np.float32),
        np.clip(albedo, 0.03, 0.9).astype(np.float32),
        rng.uniform([0, 1, 0], [0.5, 8, 3], (count + 6, 3)).astype(np.float32),
        lamps,
        _draw_window(size, rng),
    )


def _draw_lamp(size: np.ndarray, corner: np.ndarray, extent: np.ndarray, rng: Generator) -> Lamp:
    kind = rng.integers(4)
    x, y = rng.uniform(0.4, size[:2] - 0.4)
    radius = float(rng.uniform(0.06, 0.18))
    if kind == 0:
        centre, up = np.array([x, y, size[2] - rng.uniform(0.2, 0.8)]), -1
    elif kind == 1:
        centre, up = np.array([x, y, rng.uniform(1.2, 1.7)]), 1
    elif kind == 2:
        box = rng.integers(len(corner))
        on_top = corner[box] + extent[box] * [0.5, 0.5, 1] + [0, 0, radius + 0.15]
        centre, up = np.minimum(on_top, size - 0.2), int(rng.choice([-1, 1]))
    else:
        centre, up = np.array([radius + 0.05, y, rng.uniform(1.4, 2)]), 1
        centre[0] = centre[0] if rng.random() < 0.5 else size[0] - centre[0]
    warm = rng.uniform(0, 1)
    colour = np.array([1, 0.62 + 0.4 * warm, 0.28 + 0.75 * warm]) * (1 + rng.normal(0, 0.05, 3))
    power = colour * float(np.exp(rng.normal(0, 0.4)))
    lobe = float(rng.choice([0, 1, 3]))
    return Lamp(_f32(centre), radius, _f32(power), _f32([0, 0, up]), lobe)


def _draw_window(size: np.ndarray, rng: Generator) -> Lamp:
    wall = int(rng.integers(4))
    inward = np.eye(3)[wall // 2] * (1 if wall % 2 == 0 else -1)
    along = size * rng.uniform(0.3, 0.7, 3)
    centre = np.where(inward > 0, 0.0, np.where(inward < 0, size, along))
    centre[2] = 1.5
    power = np.array([0.75, 0.9, 1.1]) * float(np.exp(rng.normal(0.3, 1.0)))
    return Lamp(_f32(centre), 0.6, _f32(power), _f32(inward), 1.0, True)


def _f32(values: Any) -> np.ndarray:
    return np.asarray(values, np.float32)


def _place(room: SketchRoom, rng: Generator) -> np.ndarray:
    """An eye outside all furniture, at 1.1 to 1.7 m."""
    for _ in range(50):
        eye = rng.uniform([0.3, 0.3, 1.1], [room.size[0] - 0.3, room.size[1] - 0.3, 1.7])
        if not ((eye > room.low - 0.15) & (eye < room.high + 0.15)).all(1).any():
            return eye
    return room.size * [0.5, 0.5, 0.7]


def _camera(
    room: SketchRoom, eye: np.ndarray, target: Lamp, size_px: int, rng: Generator
) -> Camera:
    middle = room.size * [0.5, 0.5, 0.4] + rng.normal(0, 0.4, 3)
    aim = target.centre + (middle - target.centre) * rng.uniform(0, 0.5)
    if np.linalg.norm(aim - eye) < 0.3:
        aim = aim + np.array([0.3, 0.3, 0])
    return look_at(eye, aim, float(rng.uniform(60, 95)), size_px, size_px)


def _photo(room: SketchRoom, camera: Camera, on: np.ndarray, strength: np.ndarray) -> LitCrop:
    origin, rays = camera.centre.astype(np.float32), _rays(camera)
    distance, face, normal = _surface(room, origin, rays)
    lamp_distance = np.stack([_ball(lamp, origin, rays) for lamp in room.lamps])
    nearest = lamp_distance.min(0)
    lamp_hit = np.where(nearest < distance, lamp_distance.argmin(0), -1)
    points = origin + rays * distance[:, None]
    albedo = _albedo(room, face, points)
    lights = [_lit(room, lamp, points, normal, albedo) for lamp in (*room.lamps, room.window)]
    pixels = np.stack(lights) * strength[:, None, None]
    for k, lamp in enumerate(room.lamps):
        pixels[:, lamp_hit == k] *= 0.3
        pixels[k, lamp_hit == k] = lamp.power * strength[k] / (np.pi * 12 * lamp.radius**2)
    hit = np.minimum(nearest, distance)
    for k, lamp in enumerate(room.lamps):
        glow = lamp_hit == k
        normal[glow] = (origin + rays[glow] * hit[glow, None] - lamp.centre) / lamp.radius
    h, w = camera.height, camera.width
    forward = camera.c2w[:3, 2].astype(np.float32)
    return LitCrop(
        camera,
        pixels[-1].reshape(h, w, 3),
        pixels[:-1].reshape(-1, h, w, 3),
        np.stack([lamp_hit == k for k in range(len(room.lamps))]).reshape(-1, h, w),
        on,
        (hit * (rays @ forward)).reshape(h, w),
        normal.reshape(h, w, 3),
        ("lamp",) * len(room.lamps),
        1.0,
    )


def _rays(camera: Camera) -> np.ndarray:
    v, u = np.mgrid[: camera.height, : camera.width] + 0.5
    local = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, u * 0 + 1], -1)
    rays = (local.reshape(-1, 3) @ camera.c2w[:3, :3].T).astype(np.float32)
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def _surface(
    room: SketchRoom, origin: np.ndarray, rays: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distance, face number (6 walls, then boxes) and normal of the first surface of each ray."""
    safe = np.where(np.abs(rays) < 1e-6, np.float32(1e-6), rays)
    wall = np.where(safe > 0, (room.size - origin) / safe, -origin / safe)
    side = wall.argmin(1)
    distance = wall.min(1)
    face = side * 2 + (np.take_along_axis(safe, side[:, None], 1)[:, 0] > 0)
    normal = np.zeros_like(rays)
    every = np.arange(len(rays))
    normal[every, side] = -np.sign(safe[every, side])
    for box, (low, high) in enumerate(zip(room.low, room.high, strict=True)):
        near = np.minimum((low - origin) / safe, (high - origin) / safe)
        far = np.maximum((low - origin) / safe, (high - origin) / safe).min(1)
        enter, axis = near.max(1), near.argmax(1)
        hit = (enter > 0) & (enter < far) & (enter < distance)
        distance = np.where(hit, enter, distance)
        face = np.where(hit, 6 + box, face)
        normal[hit] = 0
        normal[hit, axis[hit]] = -np.sign(safe[hit, axis[hit]])
    return distance.astype(np.float32), face, normal


def _ball(lamp: Lamp, origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
    offset = origin - lamp.centre
    half = rays @ offset
    root = half**2 - offset @ offset + lamp.radius**2
    distance = np.where(root > 0, -half - np.sqrt(np.maximum(root, 0)), np.inf)
    return np.where(distance > 0, distance, np.inf)


def _albedo(room: SketchRoom, face: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Colour of the surface with a wavy pattern, so that texture and light are different things."""
    contrast, frequency, phase = room.pattern[face].T
    waves = np.sin(points * frequency[:, None] * 3 + phase[:, None])
    pattern = np.sign(waves.prod(1)) if len(face) else waves.prod(1)
    return np.clip(room.albedo[face] * (1 + 0.6 * (contrast * pattern)[:, None]), 0.02, 0.95)


def _lit(
    room: SketchRoom, lamp: Lamp, points: np.ndarray, normal: np.ndarray, albedo: np.ndarray
) -> np.ndarray:
    """Radiance that one lamp leaves on the surface: direct light and one bounce."""
    sphere = _directions(BOUNCE_POINTS)
    irradiance = np.zeros((len(points), 1), np.float32)
    lifted = points + normal * 0.01
    for direction in sphere[:SHADOW_POINTS]:
        spread = direction * (lamp.axis == 0) if lamp.flat else direction
        source = lamp.centre + spread * lamp.radius
        arriving = _arriving(lamp, source, points, normal)
        lit = arriving[:, 0] > 1e-6
        arriving[lit] *= _visible(room, lifted[lit], source)[:, None]
        irradiance += arriving / SHADOW_POINTS
    bounce = _bounce(room, lamp, points, normal, sphere)
    return albedo / np.pi * (irradiance * lamp.power + bounce)


def _arriving(lamp: Lamp, source: np.ndarray, points: np.ndarray, normal: np.ndarray) -> np.ndarray:
    offset = source - points
    squared = (offset**2).sum(1)
    towards = offset / np.sqrt(squared)[:, None]
    cosine = np.maximum((towards * normal).sum(1), 0)
    aim = np.maximum(-(towards @ lamp.axis), 0) ** lamp.lobe if lamp.lobe else 1.0
    spill = 0.15 if lamp.lobe else 0.0
    return (cosine * (aim * (1 + lamp.lobe) + spill) / np.maximum(squared, 0.01 + 0.7 * lamp.flat))[
        :, None
    ]


def _visible(room: SketchRoom, points: np.ndarray, source: np.ndarray) -> np.ndarray:
    ray = source - points
    ray = np.where(np.abs(ray) < 1e-6, np.float32(1e-6), ray)
    blocked = np.zeros(len(points), bool)
    for low, high in zip(room.low, room.high, strict=True):
        first, second = (low - points) / ray, (high - points) / ray
        enter, leave = np.minimum(first, second).max(1), np.maximum(first, second).min(1)
        blocked |= (enter < leave) & (leave > 0) & (enter < 0.97)
    return (~blocked).astype(np.float32)


def _bounce(
    room: SketchRoom, lamp: Lamp, points: np.ndarray, normal: np.ndarray, directions: np.ndarray
) -> np.ndarray:
    """Irradiance from places that the lamp lights, taken as small Lambertian sources."""
    distance, face, spot_normal = _surface(room, lamp.centre, directions)
    spots = lamp.centre + directions * distance[:, None]
    aim = np.maximum(directions @ lamp.axis, 0) ** lamp.lobe * (1 + lamp.lobe) if lamp.lobe else 1.0
    share = 4 * np.pi / len(directions) * np.maximum(aim + 0.15 * bool(lamp.lobe), 0)
    flux = room.albedo[face] * lamp.power * np.reshape(share, (-1, 1)) / np.pi
    total = np.zeros((len(points), 3), np.float32)
    for spot, out, power in zip(spots, spot_normal, flux, strict=True):
        offset = spot - points
        squared = (offset**2).sum(1)
        towards = offset / np.sqrt(squared)[:, None]
        form = np.maximum((towards * normal).sum(1), 0) * np.maximum(-(towards @ out), 0)
        total += (form / np.maximum(squared, 0.6))[:, None] * power
    # Later bounces, spread evenly: about as much again as the first in a pale room.
    return total + 0.4 * total.mean(0)


def _directions(count: int) -> np.ndarray:
    """`count` directions spread evenly over the sphere (Fibonacci), every prefix well spread."""
    i = np.arange(count)
    z = 1 - 2 * ((i * 0.618034 + 0.5) % 1)
    angle = i * 2.399963 * 1.324718
    ring = np.sqrt(1 - z**2)
    return np.stack([ring * np.cos(angle), ring * np.sin(angle), z], 1).astype(np.float32)
