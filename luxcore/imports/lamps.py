"""Lamps of an imported scene: light sources found, and those that share a fixture grouped."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from luxcore.imports.scene_file import SceneData, SceneMesh
from luxcore.light.blackbody import LUMINANCE_709
from luxcore.rooms.model import LampKind

SAME_FIXTURE_M = 0.35
"""Sources of one colour nearer than this are one lamp: a chandelier, a row of spots."""

SAME_COLOR = 0.98
"""Cosine between the colours of sources that may share a lamp."""

NAMED_POWER_W = 25.0
"""For a surface that is called a lamp but does not emit in the file (OBJ cannot say)."""

_NAME = re.compile(r"lamp|luminaire|lightbulb|bulb|(?<![a-z])light(?![a-z])", re.IGNORECASE)


@dataclass(frozen=True)
class Source:
    """One light source. `watts` is linear RGB: the light that leaves it, per channel."""

    name: str
    parent: str | None
    place: np.ndarray
    """Centre, metres, world."""
    watts: np.ndarray
    light: dict | None = None
    """Blender's light, when it is one."""
    mesh: int | None = None
    """Index of the emitting mesh, when it is one."""
    slot: int | None = None
    """Which of the mesh's materials emits; None: all of it."""


@dataclass
class LampGroup:
    """Sources that one switch turns on."""

    sources: list[Source] = field(default_factory=list)

    @property
    def watts(self) -> np.ndarray:
        return np.sum([s.watts for s in self.sources], axis=0)

    @property
    def place(self) -> np.ndarray:
        return np.mean([s.place for s in self.sources], axis=0)


def find_sources(scene: SceneData, unit_m: float) -> tuple[list[Source], list[str]]:
    """All sources that shine, and a sentence for each light that cannot be a lamp."""
    sources, notes = [], []
    for light in scene.lights:
        watts = light_watts(light)
        if light["type"] == "SUN":
            notes.append(f"the sun {light['name']} is left out: daylight comes from an environment")
        elif watts.max() > 0:
            place = np.array(light["matrix"])[:3, 3] * unit_m
            sources.append(Source(light["name"], light["parent"], place, watts, light=light))
    for index, mesh in enumerate(scene.meshes):
        sources += _emitting(mesh, index, unit_m)
    if not sources:
        named = [i for i, m in enumerate(scene.meshes) if _NAME.search(m.name)]
        for index in named:
            mesh = scene.meshes[index]
            place = _centre(mesh.vertices) * unit_m
            watts = np.full(3, NAMED_POWER_W)
            sources.append(Source(mesh.name, mesh.parent, place, watts, mesh=index))
            notes.append(f"{mesh.name} does not shine in the file: {NAMED_POWER_W:g} W by its name")
    return sources, notes


def light_watts(light: dict) -> np.ndarray:
    """Linear RGB watts that leave a light, from Blender's "energy".

    Blender's watts are those of a sphere: a spot keeps the share of its cone, and an area light,
    whose radiance is energy / (4 area), emits pi / 4 of them (Cycles, kernel/light/area.h).
    """
    factor = {"POINT": 1.0, "AREA": math.pi / 4}.get(light["type"], 1.0)
    if light["type"] == "SPOT":
        factor = (1 - math.cos(math.radians(light["cone_deg"]) / 2)) / 2
    return np.maximum(np.array(light["color"], float), 0) * max(light["energy"], 0.0) * factor


def group_sources(sources: Sequence[Source]) -> list[LampGroup]:
    """Sources under one parent, or near each other, of one colour, are one lamp."""
    groups: list[LampGroup] = []
    for source in sources:
        mine = [g for g in groups if any(_together(source, other) for other in g.sources)]
        merged = LampGroup([s for g in mine for s in g.sources] + [source])
        groups = [g for g in groups if g not in mine] + [merged]
    return sorted(groups, key=lambda g: -float(g.watts @ LUMINANCE_709))


def lamp_kind(place: np.ndarray, low: np.ndarray, high: np.ndarray) -> LampKind:
    """By where it is in the room's bounds: under the ceiling, at a wall, on the floor, on a top."""
    if place[2] > low[2] + 0.75 * (high[2] - low[2]):
        return "ceiling"
    if min((place - low)[:2].min(), (high - place)[:2].min()) < 0.35:
        return "wall"
    return "floor" if place[2] < low[2] + 0.4 else "table"


def _together(a: Source, b: Source) -> bool:
    near = float(np.linalg.norm(a.place - b.place)) < SAME_FIXTURE_M
    siblings = a.parent is not None and a.parent == b.parent
    norm = float(np.linalg.norm(a.watts) * np.linalg.norm(b.watts))
    return (near or siblings) and float(a.watts @ b.watts) > SAME_COLOR * norm


def _emitting(mesh: SceneMesh, index: int, unit_m: float) -> list[Source]:
    found = []
    for slot, material in enumerate(mesh.materials):
        radiance = np.maximum(np.array(material["emission"], float), 0)
        faces = [f for f, s in zip(mesh.faces, mesh.slots, strict=True) if s == slot]
        if radiance.max() <= 0 or not faces:
            continue
        corners = mesh.vertices[sorted({v for face in faces for v in face})]
        watts = math.pi * _area(mesh.vertices, faces) * unit_m**2 * radiance
        place = _centre(corners) * unit_m
        found.append(Source(mesh.name, mesh.parent, place, watts, mesh=index, slot=slot))
    return found


def _centre(vertices: np.ndarray) -> np.ndarray:
    return 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))


def _area(vertices: np.ndarray, faces: Sequence[tuple[int, ...]]) -> float:
    total = 0.0
    for face in faces:
        corners = vertices[list(face)]
        total += float(np.linalg.norm(np.cross(corners, np.roll(corners, -1, 0)).sum(0))) / 2
    return total
