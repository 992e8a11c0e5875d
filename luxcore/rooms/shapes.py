"""The solids that rooms are built from, as data, and their triangle-ready meshes.

Every shape lives in its own frame, in metres; faces wind counter-clockwise seen from outside, so
that emission can be limited to the front of a surface.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

Vec2 = tuple[float | int, float | int]
Vec3 = tuple[float | int, float | int, float | int]
"""Lengths in metres or angles in degrees; whole numbers may be written without a point."""

Faces = tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class Mesh:
    """Vertices in metres and polygons of three or more corners each."""

    vertices: NDArray[np.float64]
    faces: Faces

    @property
    def area_m2(self) -> float:
        """The area of all faces, each counted on its front only."""
        return float(sum(np.linalg.norm(_vector_area(self.vertices[list(f)])) for f in self.faces))


@dataclass(frozen=True)
class Box:
    """A cuboid: full edge lengths, and where its centre is in the frame."""

    size: Vec3
    center: Vec3 = (0.0, 0.0, 0.0)
    bevel: float = 0.0

    def mesh(self) -> Mesh:
        """Eight corners, or the corners of the cuboid cut by the bevel (24 corners)."""
        if self.bevel > 0:
            return _bevelled_box(self)
        corners = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], float)
        faces = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
        return Mesh(corners * np.array(self.size) / 2 + np.array(self.center), faces)


@dataclass(frozen=True)
class Lathe:
    """A profile of (radius, z) turned round z, from bottom to top for outward faces.

    A radius of 0 closes the end in a point; open ends stay open.
    """

    profile: tuple[Vec2, ...]
    segments: int = 24
    sweep_deg: float = 360.0

    def mesh(self) -> Mesh:
        """Quads between neighbouring rings; triangles at closed ends."""
        closed = self.sweep_deg >= 360.0
        count = self.segments if closed else self.segments + 1
        angles = np.radians(self.sweep_deg) * np.arange(count) / self.segments
        rings: list[tuple[int, int]] = []
        vertices: list[Vec3] = []
        for radius, z in self.profile:
            around = [(0.0, 0.0, z)] if radius <= 0 else _ring(radius, z, angles)
            rings.append((len(vertices), len(around)))
            vertices.extend(around)
        faces: list[tuple[int, ...]] = []
        for (low, n_low), (high, n_high) in pairwise(rings):
            for k in range(self.segments):
                quad = (
                    low + k % n_low,
                    low + (k + 1) % n_low,
                    high + (k + 1) % n_high,
                    high + k % n_high,
                )
                face = tuple(dict.fromkeys(quad))
                if len(face) >= 3:
                    faces.append(face)
        return Mesh(np.array(vertices, float), tuple(faces))


@dataclass(frozen=True)
class Ellipsoid:
    """Three radii round the origin; `lumps` displaces the surface (cushions, leaves, stones)."""

    radii: Vec3
    segments: int = 20
    squareness: float = 1.0

    def mesh(self) -> Mesh:
        """A lathe of half circles, raised to a power: 1 is round, 0.3 nearly a box (a cushion)."""
        rings = self.segments // 2
        thetas = np.linspace(-math.pi / 2, math.pi / 2, rings + 1)
        profile = tuple(
            (
                float(_power(math.cos(t), self.squareness)) if 0 < k < rings else 0.0,
                float(_power(math.sin(t), self.squareness)),
            )
            for k, t in enumerate(thetas)
        )
        mesh = Lathe(profile, self.segments).mesh()
        vertices = mesh.vertices.copy()
        radius = np.hypot(vertices[:, 0], vertices[:, 1])
        angle = np.arctan2(vertices[:, 1], vertices[:, 0])
        vertices[:, 0] = radius * _power_array(np.cos(angle), self.squareness)
        vertices[:, 1] = radius * _power_array(np.sin(angle), self.squareness)
        return Mesh(vertices * np.array(self.radii), mesh.faces)


@dataclass(frozen=True)
class Prism:
    """A simple polygon (counter-clockwise, x-y plane) raised by `height`, top and bottom closed.

    A height of 0 is a single face that looks up.
    """

    outline: tuple[Vec2, ...]
    height: float = 0.0

    def mesh(self) -> Mesh:
        """One n-gon for the top, one for the bottom, a quad for each edge."""
        n = len(self.outline)
        low = np.array([(x, y, 0.0) for x, y in self.outline])
        if self.height == 0:
            return Mesh(low, (tuple(range(n)),))
        high = low + np.array([0, 0, self.height])
        sides = tuple((k, (k + 1) % n, n + (k + 1) % n, n + k) for k in range(n))
        ends = (tuple(reversed(range(n))), tuple(range(n, 2 * n)))
        return Mesh(np.vstack([low, high]), sides + ends)


@dataclass(frozen=True)
class Drape:
    """A hanging cloth in the x-z plane (x from 0, z from 0 up) with folds along y."""

    width: float
    height: float
    folds: int
    depth: float
    gather: float = 0.0

    def mesh(self) -> Mesh:
        """A grid of quads that looks to -y; `gather` pulls the lower half together (0..1)."""
        columns, rows = self.folds * 8, 8
        x = np.linspace(0, 1, columns + 1)
        z = np.linspace(0, 1, rows + 1)
        grid_x, grid_z = np.meshgrid(x, z)
        pull = self.gather * np.sin(np.pi * np.clip(grid_z, 0, 1)) * 0.5
        wave = np.sin(2 * np.pi * self.folds * grid_x) * (1 - 0.3 * grid_z)
        vertices = np.stack(
            [
                (grid_x * (1 - pull)) * self.width,
                wave * self.depth / 2,
                grid_z * self.height,
            ],
            axis=-1,
        ).reshape(-1, 3)
        stride = columns + 1
        faces = tuple(
            (r * stride + c, r * stride + c + 1, (r + 1) * stride + c + 1, (r + 1) * stride + c)
            for r in range(rows)
            for c in range(columns)
        )
        return Mesh(vertices, faces)


@dataclass(frozen=True)
class Polygons:
    """Any mesh as it comes: what an imported room is made of."""

    vertices: tuple[Vec3, ...]
    faces: Faces

    def mesh(self) -> Mesh:
        """The same vertices and faces."""
        return Mesh(np.array(self.vertices, float).reshape(-1, 3), self.faces)


Shape = Box | Lathe | Ellipsoid | Prism | Drape | Polygons


def cylinder(radius: float, height: float, base: float = 0.0, segments: int = 24) -> Lathe:
    """A closed cylinder that stands on z = `base`."""
    top = base + height
    return Lathe(((0.0, base), (radius, base), (radius, top), (0.0, top)), segments)


def disc(radius: float, z: float, *, up: bool, segments: int = 24) -> Lathe:
    """A flat disc that looks up or down."""
    ends = ((radius, z), (0.0, z))
    return Lathe(ends if up else ends[::-1], segments)


def rotation_matrix(rotation_deg: Vec3) -> Float[np.ndarray, "3 3"]:
    """Euler angles in degrees about x, then y, then z (Blender's order "XYZ")."""
    (ax, ay, az) = np.radians(rotation_deg)
    cx, sx, cy, sy, cz, sz = *_cs(ax), *_cs(ay), *_cs(az)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1.0]])
    return about_z @ about_y @ about_x


def _cs(angle: float) -> tuple[float, float]:
    return math.cos(angle), math.sin(angle)


def _vector_area(corners: np.ndarray) -> np.ndarray:
    rolled = np.roll(corners, -1, axis=0)
    return np.cross(corners, rolled).sum(axis=0) / 2


def _ring(radius: float, z: float, angles: np.ndarray) -> list[Vec3]:
    return [(radius * math.cos(a), radius * math.sin(a), z) for a in angles]


def _power(value: float, exponent: float) -> float:
    return math.copysign(abs(value) ** exponent, value)


def _power_array(values: np.ndarray, exponent: float) -> np.ndarray:
    return np.copysign(np.abs(values) ** exponent, values)


def _bevelled_box(box: Box) -> Mesh:
    """Each corner becomes a triangle, each edge a strip: 24 vertices, 26 faces."""
    half = np.array(box.size) / 2
    bevel = min(box.bevel, 0.45 * float(half.min()) * 2)
    vertices: list[np.ndarray] = []
    index: dict[tuple[tuple[int, int, int], int], int] = {}
    signs = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    for sign in signs:
        for axis in range(3):
            inset = half - bevel
            inset[axis] = half[axis]
            index[sign, axis] = len(vertices)
            vertices.append(np.array(sign) * inset)
    points = np.array(vertices)
    groups: list[list[int]] = [[index[s, a] for a in range(3)] for s in signs]
    for axis in range(3):
        for side in (-1, 1):
            groups.append([index[s, axis] for s in signs if s[axis] == side])
        a, b = [k for k in range(3) if k != axis]
        for sa in (-1, 1):
            for sb in (-1, 1):
                edge = [s for s in signs if s[a] == sa and s[b] == sb]
                groups.append([index[s, k] for s in edge for k in (a, b)])
    faces = tuple(_wind_outward(points, g) for g in groups)
    return Mesh(points + np.array(box.center), faces)


def _wind_outward(points: np.ndarray, group: list[int]) -> tuple[int, ...]:
    """Order coplanar corners of a convex solid round the origin counter-clockwise from outside."""
    corners = points[group]
    centre = corners.mean(axis=0)
    normal = centre / np.linalg.norm(centre)
    u = corners[0] - centre
    u -= normal * (u @ normal)
    u /= np.linalg.norm(u)
    v = np.cross(normal, u)
    angles = np.arctan2((corners - centre) @ v, (corners - centre) @ u)
    return tuple(group[k] for k in np.argsort(angles, kind="stable"))
