"""A photographer's walk through a room: an arc at eye height that keeps the lamps in sight."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from luxcore.cameras import Camera, look_at
from luxcore.errors import LuxError
from luxcore.rooms.model import Room
from luxcore.rooms.shapes import rotation_matrix

ARC_LENGTH_M = 1.9
"""From the first to the last view: enough parallax for poses, little enough to overlap."""
TARGET_M = 2.6
"""Distance of the point that all views look at."""
HEIGHTS_M = (1.35, 1.6)
"""The walk goes there at one height and back at another."""
CLEARANCE_M = 0.3
GRID_M = 0.35
YAWS = 16


@dataclass(frozen=True)
class Obstacles:
    """Axis-aligned boxes round the parts: corners [n, 3] each, and the lamp each belongs to."""

    low: Float[np.ndarray, "n 3"]
    high: Float[np.ndarray, "n 3"]
    lamp: np.ndarray
    """[n] index of a lamp, -1 for everything else."""

    def blocks(self, point: np.ndarray) -> bool:
        """Whether something is nearer than the clearance at the camera's height."""
        near = (point > self.low - CLEARANCE_M) & (point < self.high + CLEARANCE_M)
        return bool(near.all(axis=1).any())

    def hides(self, eye: np.ndarray, goal: np.ndarray, lamp: int) -> bool:
        """Whether a part of anything but this lamp is between two points (slab test)."""
        direction = goal - eye
        safe = np.where(np.abs(direction) < 1e-9, 1e-9, direction)
        first, second = (self.low - eye) / safe, (self.high - eye) / safe
        enter = np.minimum(first, second).max(axis=1)
        leave = np.maximum(first, second).min(axis=1)
        hit = (enter < leave) & (leave > 0) & (enter < 0.97)
        return bool((hit & (self.lamp != lamp)).any())


def obstacles(room: Room) -> Obstacles:
    """Boxes of all parts; floor and ceiling included."""
    lows, highs = [], []
    for part in room.parts:
        turned = part.shape.mesh().vertices @ rotation_matrix(part.rotation_deg).T
        corners = turned + np.array(part.position)
        lows.append(corners.min(axis=0))
        highs.append(corners.max(axis=0))
    lamps = np.array([-1 if p.lamp is None else p.lamp for p in room.parts])
    return Obstacles(np.array(lows), np.array(highs), lamps)


def walk(room: Room, count: int, fov_x_deg: float, width: int, height: int) -> tuple[Camera, ...]:
    """`count` cameras on the arc that sees most lamps, most often.

    Raises LuxError when no arc fits into the room.
    """
    boxes = obstacles(room)
    best: tuple[float, tuple[Camera, ...]] = (-1.0, ())
    for eye in _standpoints(room, boxes):
        for yaw in np.arange(YAWS) * 2 * math.pi / YAWS:
            cameras = _arc(eye, yaw, 6, fov_x_deg, width, height)
            if not all(_inside(room, c.centre) and not boxes.blocks(c.centre) for c in cameras):
                continue
            score = _score(room, boxes, cameras)
            if score > best[0]:
                best = (score, _arc(eye, yaw, count, fov_x_deg, width, height))
    if not best[1]:
        raise LuxError(f"room {room.id} has no place for a walk of {ARC_LENGTH_M} m.")
    return best[1]


def lamps_in_sight(room: Room, boxes: Obstacles, camera: Camera) -> Bool[np.ndarray, " lamps"]:
    """Which lamps' centres are in the picture and not hidden."""
    seen = []
    for lamp in room.lamps:
        goal = np.array(lamp.position)
        x, y, z = (camera.viewmat @ np.array([*goal, 1.0]))[:3]
        u, v = camera.fx * x / max(z, 1e-6) + camera.cx, camera.fy * y / max(z, 1e-6) + camera.cy
        framed = z > 0.4 and 0 < u < camera.width and 0 < v < camera.height
        seen.append(framed and not boxes.hides(camera.centre, goal, lamp.id))
    return np.array(seen, bool)


def _score(room: Room, boxes: Obstacles, cameras: tuple[Camera, ...]) -> float:
    """The lamp seen least counts most; depth of view breaks ties (more of the room)."""
    share = np.mean([lamps_in_sight(room, boxes, c) for c in cameras], axis=0)
    middle = cameras[len(cameras) // 2]
    ahead = middle.c2w[:3, 2]
    steps = np.arange(0.5, 6.0, 0.25)
    depth = sum(_inside(room, middle.centre + s * ahead) for s in steps) / len(steps)
    return float(10 * share.min() + 3 * share.mean() + depth)


def _arc(
    eye: np.ndarray, yaw: float, count: int, fov_x_deg: float, width: int, height: int
) -> tuple[Camera, ...]:
    """There and back: positions on a circle round the target, two heights, a slow nod."""
    forward = np.array([math.cos(yaw), math.sin(yaw), 0.0])
    right = np.array([math.sin(yaw), -math.cos(yaw), 0.0])
    target = eye + TARGET_M * forward
    half = ARC_LENGTH_M / 2 / TARGET_M
    there = (count + 1) // 2
    angles = [np.linspace(-half, half, there), np.linspace(half, -half, count - there)]
    cameras = []
    for level, row in zip(HEIGHTS_M, angles, strict=True):
        for angle in row:
            spot = target - TARGET_M * (math.cos(angle) * forward - math.sin(angle) * right)
            position = np.array([spot[0], spot[1], level])
            goal = np.array([target[0], target[1], 1.3 + 0.15 * math.sin(3 * angle)])
            cameras.append(look_at(position, goal, fov_x_deg, width, height))
    return tuple(cameras)


def _standpoints(room: Room, boxes: Obstacles) -> list[np.ndarray]:
    corners = np.array(room.outline)
    low, high = corners.min(axis=0) + CLEARANCE_M, corners.max(axis=0) - CLEARANCE_M
    points = [
        np.array([x, y, HEIGHTS_M[0]])
        for x in np.arange(low[0], high[0], GRID_M)
        for y in np.arange(low[1], high[1], GRID_M)
    ]
    return [p for p in points if _inside(room, p) and not boxes.blocks(p)]


def _inside(room: Room, point: np.ndarray) -> bool:
    """Even-odd rule on the outline of the floor."""
    x, y = float(point[0]), float(point[1])
    inside = False
    ends = (*room.outline[1:], room.outline[0])
    for (x0, y0), (x1, y1) in zip(room.outline, ends, strict=True):
        if (y0 > y) != (y1 > y) and x < (x1 - x0) * (y - y0) / (y1 - y0) + x0:
            inside = not inside
    return inside
