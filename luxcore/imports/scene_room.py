"""A scene of another program as a Room: surfaces as they are, lamps behind switches.

Kept: shapes, base colours, roughness, metal and glass, powers and colours of lamps. Lost: textures
(their mean colour stays), volumes, node trees, suns and worlds.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from luxcore.cameras import OPENGL_FROM_OPENCV, Camera
from luxcore.errors import InputError
from luxcore.imports.lamps import LampGroup, Source, find_sources, group_sources, lamp_kind
from luxcore.imports.scene_file import SceneData, SceneMesh
from luxcore.imports.standpoints import standpoints
from luxcore.light.blackbody import LUMINANCE_709
from luxcore.rooms.model import Lamp, Material, MaterialKind, Part, Room, Spot
from luxcore.rooms.shapes import Ellipsoid, Lathe, Polygons, Shape, Vec3, disc

IMPORT_SEED = 0
TALL_M = 30.0
"""A room higher than this is taken to be in centimetres, or in millimetres."""

EYE_HEIGHT_M = 1.5
MAX_VIEWPOINTS = 4
_MIN_RADIUS_M = 0.01
_LAMP = "lamp"


@dataclass(frozen=True)
class ImportedRoom:
    """The room, the cameras of the file, and what could not be kept, one sentence each."""

    room: Room
    cameras: tuple[Camera, ...]
    notes: tuple[str, ...]


def scene_to_room(scene: SceneData, unit_m: float | None = None) -> ImportedRoom:
    """`unit_m`: metres in one unit of the file, where the file does not say it right.

    Raises InputError when no surface of the file shines or is called a lamp.
    """
    everything = np.concatenate([mesh.vertices for mesh in scene.meshes])
    scale = unit_m or _guess_unit(scene, everything)
    low, high = everything.min(axis=0) * scale, everything.max(axis=0) * scale
    sources, notes = find_sources(scene, scale)
    if not sources:
        raise InputError(f"{scene.path} has no lamp: nothing in it shines or is called one.")
    if scale != scene.unit_m and unit_m is None:
        notes.append(f"one unit is taken to be {scale:g} m, since the room would be too high")
    move = _Move(scale, np.array([0.0, 0.0, -low[2]]))
    groups = group_sources(sources)
    materials: dict[str, Material] = {_LAMP: Material("paint", (0.8, 0.8, 0.8))}
    parts = [p for i, m in enumerate(scene.meshes) for p in _surface(i, m, groups, materials, move)]
    spots: list[Spot] = []
    for index, group in enumerate(groups):
        bodies, beams = _bulbs(index, group, move)
        parts += bodies
        spots += beams
    top = max(float(high[2]), max(float(s.place[2]) for s in sources))
    cameras = tuple(_camera(c, move) for c in scene.cameras if c["perspective"])
    floor, ceiling = low + move.shift, np.array([*high[:2], top]) + move.shift
    room = Room(
        seed=IMPORT_SEED,
        use="imported",
        outline=((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])),
        height=float(ceiling[2]),
        materials=materials,
        parts=tuple(parts),
        lamps=_lamps(groups, floor, ceiling, move),
        spots=tuple(spots),
        openings=(),
        environment=None,
        viewpoints=_viewpoints(scene, cameras, float(ceiling[2]), move),
    )
    return ImportedRoom(room, cameras, tuple(notes))


@dataclass(frozen=True)
class _Move:
    """From the file's units to metres with the floor at z = 0."""

    scale: float
    shift: np.ndarray

    def points(self, xyz: np.ndarray) -> np.ndarray:
        return xyz * self.scale + self.shift


def _viewpoints(
    scene: SceneData, cameras: Sequence[Camera], height_m: float, move: _Move
) -> tuple[Vec3, ...]:
    fans = [
        move.points(mesh.vertices[[face[0], face[k], face[k + 1]]])
        for mesh in scene.meshes
        for face in mesh.faces
        for k in range(1, len(face) - 1)
    ]
    eye = min(EYE_HEIGHT_M, 0.6 * height_m)
    wanted = [camera.centre for camera in cameras]
    return tuple(_vec(p) for p in standpoints(np.array(fans), eye, wanted, MAX_VIEWPOINTS))


def _guess_unit(scene: SceneData, vertices: np.ndarray) -> float:
    height = float(np.ptp(vertices[:, 2])) * scene.unit_m
    return scene.unit_m * (1.0 if height <= TALL_M else 0.01 if height <= 100 * TALL_M else 0.001)


def _surface(
    index: int,
    mesh: SceneMesh,
    groups: list[LampGroup],
    materials: dict[str, Material],
    move: _Move,
) -> list[Part]:
    """One part per material of the mesh; emitting ones belong to their lamp."""
    parts = []
    vertices = move.points(mesh.vertices)
    for slot in sorted({int(s) for s in mesh.slots}):
        faces = [f for f, s in zip(mesh.faces, mesh.slots, strict=True) if s == slot]
        shape = _compact(vertices, faces)
        lamp, emits = _emission(index, slot, groups)
        facts = mesh.materials[slot] if slot < len(mesh.materials) else None
        name = _LAMP if lamp is not None else _add_material(materials, facts)
        parts.append(Part(mesh.name, shape, name, lamp=lamp, emits=emits))
    return parts


def _compact(vertices: np.ndarray, faces: list[tuple[int, ...]]) -> Polygons:
    used = sorted({v for face in faces for v in face})
    place = {v: i for i, v in enumerate(used)}
    renamed = tuple(tuple(place[v] for v in face) for face in faces)
    return Polygons(tuple(_vec(vertices[v]) for v in used), renamed)


def _emission(mesh: int, slot: int, groups: list[LampGroup]) -> tuple[int | None, float]:
    """Which lamp a surface belongs to and the share of that lamp's light it gives."""
    for index, group in enumerate(groups):
        for source in group.sources:
            if source.mesh == mesh and source.slot in (None, slot):
                return index, _share(source, group)
    return None, 0.0


def _share(source: Source, group: LampGroup) -> float:
    return float(source.watts @ LUMINANCE_709) / float(group.watts @ LUMINANCE_709)


def _add_material(materials: dict[str, Material], facts: dict[str, Any] | None) -> str:
    """The nearest material that the renderer of rooms has."""
    if facts is None:
        return _LAMP
    kind: MaterialKind = "paint"
    if facts["transmission"] > 0.5:
        kind = "glass"
    elif facts["metallic"] > 0.5:
        kind = "metal"
    name = f"{kind}_{facts['name'] or 'none'}"
    color = _vec(np.clip(facts["color"], 0, 1))
    materials[name] = Material(kind, color, color, float(np.clip(facts["roughness"], 0, 1)))
    return name


def _bulbs(index: int, group: LampGroup, move: _Move) -> tuple[list[Part], list[Spot]]:
    """Bodies for Blender's point and area lights, beams for its spots."""
    parts: list[Part] = []
    spots: list[Spot] = []
    for source in group.sources:
        if source.light is None:
            continue
        light, share = source.light, _share(source, group)
        matrix = np.array(light["matrix"])
        place = _vec(source.place + move.shift)
        radius = max(light["radius"] * move.scale, _MIN_RADIUS_M)
        if light["type"] == "SPOT":
            axes = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
            cone, blend = light["cone_deg"], light["blend"]
            spots.append(Spot(index, place, _vec(-axes[:, 2]), cone, blend, radius, share))
            continue
        shape: Shape = Ellipsoid((radius, radius, radius))
        turn: Vec3 = (0.0, 0.0, 0.0)
        if light["type"] == "AREA":
            shape, turn = _area_shape(light, matrix, move.scale)
        parts.append(Part(source.name, shape, _LAMP, place, turn, lamp=index, emits=share))
    return parts, spots


def _area_shape(light: dict[str, Any], matrix: np.ndarray, scale: float) -> tuple[Shape, Vec3]:
    """A disc or rectangle that shines along the light's -z, and its Euler angles in degrees."""
    stretch = np.linalg.norm(matrix[:3, :3], axis=0)
    width, depth = np.array(light["size"]) * stretch[:2] * scale / 2
    turn = Rotation.from_matrix(matrix[:3, :3] / stretch).as_euler("xyz", degrees=True)
    if light["round"] and abs(width - depth) < 1e-6:
        flat: Lathe = disc(float(width), 0.0, up=False)
        return flat, _vec(turn)
    corners = ((-width, -depth, 0), (-width, depth, 0), (width, depth, 0), (width, -depth, 0))
    return Polygons(tuple(_vec(c) for c in corners), ((0, 1, 2, 3),)), _vec(turn)


def _lamps(
    groups: Sequence[LampGroup], low: np.ndarray, high: np.ndarray, move: _Move
) -> tuple[Lamp, ...]:
    """A lamp per group; those of one name, such as a mesh that shines in two colours, numbered."""
    lamps = [_lamp(i, g, low, high, move) for i, g in enumerate(groups)]
    names = Counter(lamp.name for lamp in lamps)
    return tuple(
        replace(lamp, name=f"{lamp.name}_{lamp.id}") if names[lamp.name] > 1 else lamp
        for lamp in lamps
    )


def _lamp(index: int, group: LampGroup, low: np.ndarray, high: np.ndarray, move: _Move) -> Lamp:
    place = group.place + move.shift
    power = float(group.watts @ LUMINANCE_709)
    kind = lamp_kind(place, low, high)
    # The colour's temperature is not known; 0 stands for a colour that is no black body's.
    name = group.sources[0].name if len(group.sources) == 1 else f"{kind}_{index}"
    return Lamp(
        index, name, kind, "imported", _vec(place), power, 0.0, _vec(group.watts / power), True
    )


def _camera(facts: dict[str, Any], move: _Move) -> Camera:
    width, height = facts["size"]
    fit = facts["fit"]
    wide = fit == "HORIZONTAL" or (fit == "AUTO" and width >= height)
    side = width if wide else height
    focal = 0.5 * side / float(np.tan(facts["angle"] / 2))
    placed = np.array(facts["matrix"])
    c2w = np.eye(4)
    c2w[:3, :3] = _unmirrored(placed[:3, :3])
    c2w[:3, 3] = move.points(placed[:3, 3])
    shift_x, shift_y = facts["shift"]
    cx, cy = width / 2 - shift_x * side, height / 2 + shift_y * side
    return Camera(focal, focal, cx, cy, width, height, c2w @ OPENGL_FROM_OPENCV)


def _unmirrored(axes: np.ndarray) -> np.ndarray:
    """[3, 3] rotation that looks as `axes` (OpenGL's) do; a parent may scale, skew or mirror."""
    back = axes[:, 2] / np.linalg.norm(axes[:, 2])
    right = np.cross(axes[:, 1], back)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(back, right), back], axis=1)


def _vec(values: Any) -> Vec3:
    x, y, z = (round(float(v), 6) for v in values)
    return (x, y, z)
