"""The structured scene language of Aria Synthetic Environments: walls, doors, windows, boxes.

    make_wall, id=0, a_x=-2.5, a_y=1.0, a_z=0.0, b_x=2.5, b_y=1.0, b_z=0.0, height=2.7
    make_door, id=1000, wall0_id=0, wall1_id=-1, position_x=0, position_y=1, position_z=1, width=...

Every error names the file and the line. Source: Avetisyan et al. 2024, "SceneScript", section 3.
"""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path

from luxcore.errors import FormatError, InputError

MAX_BYTES, MAX_LINES = 4_000_000, 20_000
MAX_METRES = 1000.0
_CROSSING_M = 0.02
"""Walls may touch or overlap at their ends by this much without crossing."""


@dataclass(frozen=True)
class WallLine:
    """A straight wall from a to b; z of its foot, metres."""

    line: int
    a: tuple[float, float]
    b: tuple[float, float]
    foot_z: float
    height: float
    thickness: float

    @property
    def length(self) -> float:
        return math.dist(self.a, self.b)


@dataclass(frozen=True)
class OpeningLine:
    """A door or window: the id of its wall, its centre, its size."""

    line: int
    kind: str
    wall: int
    centre: tuple[float, float, float]
    width: float
    height: float


@dataclass(frozen=True)
class BoxLine:
    """An object as an upright box: centre, yaw, full sizes."""

    line: int
    label: str
    centre: tuple[float, float, float]
    yaw_rad: float
    size: tuple[float, float, float]


@dataclass
class LanguageScene:
    """All entities of a file, in its order; walls by id."""

    walls: dict[int, WallLine] = field(default_factory=dict)
    openings: list[OpeningLine] = field(default_factory=list)
    boxes: list[BoxLine] = field(default_factory=list)


COMMANDS = ("make_wall", "make_door", "make_window", "make_bbox")


def read_scene_language(path: Path) -> LanguageScene:
    """Parse and check a file. Raises InputError (missing, too long) or FormatError (with line)."""
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path} does not exist.")
    if path.stat().st_size > MAX_BYTES:
        raise InputError(f"{path} is larger than {MAX_BYTES} bytes, too large for one room.")
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError as error:
        raise FormatError(f"{path} is not text: {error.reason}.") from error
    if len(lines) > MAX_LINES:
        raise InputError(f"{path} has {len(lines)} lines, more than {MAX_LINES}.")
    scene = LanguageScene()
    for number, text in enumerate(lines, start=1):
        if text.strip() and not text.lstrip().startswith("#"):
            _Line(path, number, text).add_to(scene)
    _check(path, scene)
    return scene


class _Line:
    """One command with its arguments, and errors that say where it is."""

    def __init__(self, path: Path, number: int, text: str) -> None:
        self.path, self.number = path, number
        command, *rest = [part.strip() for part in text.split(",")]
        self.command = command
        self.values: dict[str, str] = {}
        for part in rest:
            key, equals, value = part.partition("=")
            if not equals:
                raise self.error(f"{part!r:.40} lacks a = sign")
            self.values[key.strip()] = value.strip()

    def error(self, fact: str) -> FormatError:
        return FormatError(f"{self.path}, line {self.number}: {fact}.")

    def number_of(self, key: str, default: float | None = None) -> float:
        if key not in self.values:
            if default is None:
                raise self.error(f"{self.command} lacks {key}")
            return default
        try:
            value = float(self.values[key])
        except ValueError:
            raise self.error(f"{key} is {self.values[key]!r:.40}, not a number") from None
        if not math.isfinite(value) or (abs(value) > MAX_METRES and not key.endswith("id")):
            raise self.error(f"{key} is {self.values[key]}, which no room has")
        return value

    def size_of(self, key: str) -> float:
        value = self.number_of(key)
        if value <= 0:
            raise self.error(f"{key} must be positive, got {value:g}")
        return value

    def place(self) -> tuple[float, float, float]:
        x, y, z = (self.number_of(f"position_{axis}") for axis in "xyz")
        return x, y, z

    def add_to(self, scene: LanguageScene) -> None:
        if self.command == "make_wall":
            self._add_wall(scene)
        elif self.command in ("make_door", "make_window"):
            kind = self.command.removeprefix("make_")
            wall = int(self.number_of("wall0_id"))
            size = self.size_of("width"), self.size_of("height")
            scene.openings.append(OpeningLine(self.number, kind, wall, self.place(), *size))
        elif self.command == "make_bbox":
            x, y, z = (self.size_of(f"scale_{axis}") for axis in "xyz")
            label = self.values.get("class", "object")
            yaw = self.number_of("angle_z", 0.0)
            scene.boxes.append(BoxLine(self.number, label, self.place(), yaw, (x, y, z)))
        else:
            near = difflib.get_close_matches(self.command, COMMANDS, n=1)
            hint = f"did you mean {near[0]}" if near else f"known are {', '.join(COMMANDS)}"
            raise self.error(f"unknown command {self.command!r:.40}; {hint}")

    def _add_wall(self, scene: LanguageScene) -> None:
        number = int(self.number_of("id"))
        if number in scene.walls:
            raise self.error(f"wall {number} was made before, in line {scene.walls[number].line}")
        wall = WallLine(
            self.number,
            (self.number_of("a_x"), self.number_of("a_y")),
            (self.number_of("b_x"), self.number_of("b_y")),
            self.number_of("a_z", 0.0),
            self.size_of("height"),
            max(self.number_of("thickness", 0.0), 0.0),
        )
        if wall.length < 1e-3:
            raise self.error(f"wall {number} has no length")
        scene.walls[number] = wall


def _check(path: Path, scene: LanguageScene) -> None:
    if len(scene.walls) < 3:
        raise FormatError(f"{path} has {len(scene.walls)} walls; a room needs three.")
    for opening in scene.openings:
        if opening.wall not in scene.walls:
            raise FormatError(
                f"{path}, line {opening.line}: the {opening.kind} is in wall {opening.wall}, "
                "which does not exist."
            )
    for first, second in combinations(scene.walls.values(), 2):
        if _cross(first, second):
            raise FormatError(
                f"{path}, line {second.line}: this wall crosses the one of line {first.line}."
            )


def _cross(first: WallLine, second: WallLine) -> bool:
    """Whether two walls cut each other away from their ends."""
    (ax, ay), (bx, by) = first.a, first.b
    (cx, cy), (dx, dy) = second.a, second.b
    ux, uy, vx, vy = bx - ax, by - ay, dx - cx, dy - cy
    turn = ux * vy - uy * vx
    if abs(turn) < 1e-9 * first.length * second.length:
        return False
    along_first = ((cx - ax) * vy - (cy - ay) * vx) / turn
    along_second = ((cx - ax) * uy - (cy - ay) * ux) / turn
    slack_first, slack_second = _CROSSING_M / first.length, _CROSSING_M / second.length
    return (
        slack_first < along_first < 1 - slack_first
        and slack_second < along_second < 1 - slack_second
    )
