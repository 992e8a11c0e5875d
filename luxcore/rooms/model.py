"""A room as plain data: parts, materials, lamps, openings, environment, places to look from.

Frozen, without Blender, and equal to its JSON: `Room.from_json(room.to_json()) == room`.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Literal

from luxcore.errors import FormatError
from luxcore.rooms import shapes
from luxcore.rooms.shapes import Shape, Vec2, Vec3

ROOM_VERSION = 2

LampKind = Literal["ceiling", "wall", "floor", "table"]
MaterialKind = Literal[
    "paint",
    "stripes",
    "damask",
    "planks",
    "tile",
    "carpet",
    "rug",
    "fabric",
    "wood",
    "metal",
    "ceramic",
    "glass",
    "pane",
    "mirror",
    "leaf",
    "picture",
    "stone",
    "paper",
    "screen",
    "brick",
]


@dataclass(frozen=True)
class Material:
    """What a surface looks like; `luxcore.render.materials` turns each kind into Cycles nodes.

    Colours are linear Rec.709 reflectances in 0..1; `scale` is the size of the pattern in metres.
    """

    kind: MaterialKind
    color: Vec3
    color2: Vec3 = (0.5, 0.5, 0.5)
    roughness: float = 0.6
    scale: float = 0.1
    seed: int = 0


@dataclass(frozen=True)
class Part:
    """One solid of the room, in the world frame.

    `rotation_deg` is Euler x-y-z. `lamp` is the index of the lamp whose fixture this is, and
    `emits` the share (0..1) of that lamp's power that leaves through this part's front faces.
    """

    name: str
    shape: Shape
    material: str
    position: Vec3 = (0.0, 0.0, 0.0)
    rotation_deg: Vec3 = (0.0, 0.0, 0.0)
    lamp: int | None = None
    emits: float = 0.0
    smooth: bool = False


@dataclass(frozen=True)
class Spot:
    """A beam inside a fixture: the share `emits` of the lamp's power, full cone in degrees."""

    lamp: int
    position: Vec3
    direction: Vec3
    cone_deg: float
    blend: float
    radius_m: float
    emits: float


@dataclass(frozen=True)
class Lamp:
    """One switch. Power in watts of light; `color` is linear Rec.709 of luminance about 1."""

    id: int
    name: str
    kind: LampKind
    design: str
    position: Vec3
    power_w: float
    temperature_k: float
    color: Vec3
    on: bool

    @property
    def scale(self) -> Vec3:
        """The factor c of the paper's equation 1: power times colour."""
        r, g, b = self.color
        return (self.power_w * r, self.power_w * g, self.power_w * b)


@dataclass(frozen=True)
class Opening:
    """A window or a doorway to the outside: centre of the hole, its size, the inward normal."""

    kind: Literal["window", "door"]
    center: Vec3
    width: float
    height: float
    inward: Vec2


@dataclass(frozen=True)
class Environment:
    """What is outside: an HDRI by name (Blender's own) or path, turned about z, mean radiance."""

    hdri: str
    rotation_deg: float
    mean_radiance: float


@dataclass(frozen=True)
class Room:
    """A furnished room. The floor is at z = 0; `outline` is counter-clockwise, in metres."""

    seed: int
    use: str
    outline: tuple[Vec2, ...]
    height: float
    materials: dict[str, Material]
    parts: tuple[Part, ...]
    lamps: tuple[Lamp, ...]
    spots: tuple[Spot, ...]
    openings: tuple[Opening, ...]
    environment: Environment | None
    viewpoints: tuple[Vec3, ...]

    @property
    def id(self) -> str:
        """The name of the room: its seed, in six digits or more."""
        return f"{self.seed:06d}"

    def to_json(self) -> dict[str, Any]:
        """Plain JSON values; shapes carry their class name in "shape"."""
        value = dataclasses.asdict(self)
        for raw, part in zip(value["parts"], self.parts, strict=True):
            raw["shape"] = {"type": type(part.shape).__name__, **dataclasses.asdict(part.shape)}
        return {"version": ROOM_VERSION, **_listed(value)}

    @staticmethod
    def from_json(value: dict[str, Any]) -> Room:
        """The inverse of `to_json`. Raises FormatError for another version or missing fields."""
        if value.get("version") != ROOM_VERSION:
            raise FormatError(
                f"room has version {value.get('version')}, this program reads {ROOM_VERSION}."
            )
        try:
            return _room(value)
        except (KeyError, TypeError, ValueError) as error:
            raise FormatError(f"room is incomplete or damaged: {error!r}.") from error


def _room(value: dict[str, Any]) -> Room:
    environment = value["environment"]
    return Room(
        seed=int(value["seed"]),
        use=value["use"],
        outline=_tupled(value["outline"]),
        height=value["height"],
        materials={k: Material(**_fields(v)) for k, v in value["materials"].items()},
        parts=tuple(_part(v) for v in value["parts"]),
        lamps=tuple(Lamp(**_fields(v)) for v in value["lamps"]),
        spots=tuple(Spot(**_fields(v)) for v in value["spots"]),
        openings=tuple(Opening(**_fields(v)) for v in value["openings"]),
        environment=None if environment is None else Environment(**environment),
        viewpoints=_tupled(value["viewpoints"]),
    )


def _part(value: dict[str, Any]) -> Part:
    fields = dict(value)
    shape = dict(fields.pop("shape"))
    kinds = {
        s.__name__: s
        for s in (
            shapes.Box,
            shapes.Lathe,
            shapes.Ellipsoid,
            shapes.Prism,
            shapes.Drape,
            shapes.Polygons,
        )
    }
    kind = kinds[shape.pop("type")]
    return Part(shape=kind(**_fields(shape)), **_fields(fields))


def _fields(value: dict[str, Any]) -> dict[str, Any]:
    return {k: _tupled(v) for k, v in value.items()}


def _tupled(value: Any) -> Any:
    return tuple(_tupled(v) for v in value) if isinstance(value, list) else value


def _listed(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _listed(v) for k, v in value.items()}
    return [_listed(v) for v in value] if isinstance(value, list | tuple) else value
