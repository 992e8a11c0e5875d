"""A piece of furniture in its own frame: centre of the footprint on the floor, front towards +y."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from luxcore.rooms.model import Part
from luxcore.rooms.shapes import Box, Shape, Vec2, Vec3


@dataclass(frozen=True)
class Top:
    """A free horizontal surface that can carry things: centre, size, height."""

    center: Vec2
    width: float
    depth: float
    z: float


@dataclass(frozen=True)
class Piece:
    """Parts, the footprint they need (width along x, depth along y), the height, free surfaces."""

    name: str
    parts: tuple[Part, ...]
    width: float
    depth: float
    height: float
    tops: tuple[Top, ...] = ()


def part(
    name: str,
    shape: Shape,
    material: str,
    at: Vec3 = (0.0, 0.0, 0.0),
    turn: Vec3 = (0.0, 0.0, 0.0),
    smooth: bool = False,
) -> Part:
    """A part of furniture (no lamp)."""
    return Part(name, shape, material, at, turn, smooth=smooth)


def block(name: str, material: str, size: Vec3, at: Vec3, bevel: float = 0.0) -> Part:
    """A box whose BOTTOM centre is `at`."""
    shape = Box(size, (0.0, 0.0, size[2] / 2), bevel)
    return Part(name, shape, material, at)


def placed(parts: tuple[Part, ...], at: Vec3, yaw_deg: float = 0.0) -> tuple[Part, ...]:
    """Parts turned about z, then moved. Euler x-y-z lets the turn add to the z angle."""
    return tuple(
        replace(
            p,
            position=moved(p.position, at, yaw_deg),
            rotation_deg=(
                p.rotation_deg[0],
                p.rotation_deg[1],
                round(p.rotation_deg[2] + yaw_deg, 4),
            ),
        )
        for p in parts
    )


def moved(point: Vec3, at: Vec3, yaw_deg: float) -> Vec3:
    """A point turned about z, then moved."""
    c, s = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    x, y, z = point
    return (round(at[0] + c * x - s * y, 5), round(at[1] + s * x + c * y, 5), round(at[2] + z, 5))
