"""Aria's scene language: rooms out of good files, and the line named in bad ones."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from luxcore.errors import FormatError, InputError
from luxcore.imports import import_room
from luxcore.imports.outline import floor_outline, is_inside, signed_area, spread_points
from luxcore.imports.scene_language import read_scene_language
from luxcore.rooms.model import Room

WALLS = [
    (0, 0, 0, 5, 0),
    (1, 5, 4, 5, 0),
    (2, 0, 4, 5, 4),
    (3, 0, 4, 0, 0),
]
DOOR = "make_door, id=1000, wall0_id=0, wall1_id=-1, position_x=4, position_y=0, position_z=1.5, "
WINDOW = "make_window, id=2000, wall0_id=2, wall1_id=-1, position_x=2, position_y=4, position_z=2, "
SOFA = "make_bbox, id=3000, class=sofa, position_x=1, position_y=1, position_z=0.9, angle_z=0.3, "
LAMP = "make_bbox, id=3001, class=floor lamp, position_x=4, position_y=3, position_z=1.3, "


def _wall(number: float, ax: float, ay: float, bx: float, by: float) -> str:
    return (
        f"make_wall, id={number}, a_x={ax}, a_y={ay}, a_z=0.5, b_x={bx}, b_y={by}, b_z=0.5, "
        "height=2.7, thickness=0.0"
    )


def _lines() -> list[str]:
    return [
        *(_wall(*w) for w in WALLS),
        DOOR + "width=0.9, height=2.0",
        WINDOW + "width=1.4, height=1.2",
        SOFA + "scale_x=1.8, scale_y=0.9, scale_z=0.8",
        LAMP + "scale_x=0.4, scale_y=0.4, scale_z=1.6",
    ]


def _file(folder: Path, lines: list[str]) -> Path:
    (folder / "room.txt").write_text("\n".join(lines) + "\n")
    return folder / "room.txt"


def test_a_room_of_four_walls(tmp_path: Path) -> None:
    room = import_room(_file(tmp_path, _lines()), seed=3).room
    assert signed_area(room.outline) == pytest.approx(20)
    assert room.height == 2.7
    assert [lamp.kind for lamp in room.lamps] == ["floor"]
    # Arc lamps reach almost a metre beyond their foot.
    assert np.hypot(*np.subtract(room.lamps[0].position[:2], (4, 3))) < 1
    window = room.openings[0]
    assert window.inward == pytest.approx((0, -1))
    assert window.center == pytest.approx((2, 4.06, 1.5))
    vertices = np.concatenate(
        [p.shape.mesh().vertices + p.position for p in room.parts if p.name == "floor"]
    )
    assert vertices[:, 2].max() == 0
    names = [part.name for part in room.parts]
    assert names.count("door") == 1
    assert names.count("sofa") == 1
    assert all(is_inside(room.outline, x, y) for x, y, _ in room.viewpoints)
    again = Room.from_json(json.loads(json.dumps(room.to_json())))
    assert again == room
    assert import_room(tmp_path / "room.txt", seed=3).room == room


def test_the_window_is_a_hole(tmp_path: Path) -> None:
    """A ray from the room's middle through the window's centre meets no wall."""
    from luxcore.rooms.shapes import rotation_matrix

    room = import_room(_file(tmp_path, _lines())).room
    for part in (p for p in room.parts if p.name == "wall"):
        turned = part.shape.mesh().vertices @ rotation_matrix(part.rotation_deg).T
        corners = turned + np.array(part.position)
        low, high = corners.min(axis=0), corners.max(axis=0)
        for y in np.linspace(3.9, 4.3, 9):
            assert not ((low < [2, y, 1.5]) & (high > [2, y, 1.5])).all()


def test_a_room_without_lamps_gets_ceiling_lamps(tmp_path: Path) -> None:
    room = import_room(_file(tmp_path, _lines()[:7])).room
    assert [lamp.kind for lamp in room.lamps] == ["ceiling"]
    assert room.lamps[0].position[:2] == pytest.approx((2.5, 2.0), abs=0.3)


def test_walls_that_close_no_loop_use_their_bounds(tmp_path: Path) -> None:
    lines = [*_lines(), _wall(9, 2, 0, 2, 3)]
    room = import_room(_file(tmp_path, lines)).room
    assert signed_area(room.outline) == pytest.approx(20)
    assert len(room.outline) == 4


def test_loops_of_any_order_and_direction(tmp_path: Path) -> None:
    ell = [(0, 0, 6, 0), (6, 2, 6, 0), (3, 2, 6, 2), (3, 2, 3, 5), (0, 5, 3, 5), (0, 0, 0, 5)]
    lines = [_wall(i, *w) for i, w in enumerate(reversed(ell))]
    scene = read_scene_language(_file(tmp_path, lines))
    outline = floor_outline(list(scene.walls.values()))
    assert signed_area(outline) == pytest.approx(21)
    assert len(outline) == 6
    points = spread_points(outline, 3)
    assert len(set(points)) == 3
    assert all(is_inside(outline, *p) for p in points)


@pytest.mark.parametrize(
    ("line", "text", "fact"),
    [
        (2, "make_roof, id=1", "line 2: unknown command 'make_roof'; did you mean make_door"),
        (3, _wall(2, 0, 4, 5, 4).replace("a_x=0", "a_x 0"), "line 3: .* lacks a = sign"),
        (3, _wall(2, 0, 4, 5, 4).replace("a_x=0", "a_x=nan"), "line 3: a_x is nan"),
        (3, _wall(2, 0, 4, 5, 4).replace("a_x=0", "a_x=left"), "line 3: a_x is 'left'"),
        (3, _wall(2, 0, 4, 5, 4).replace("a_x=0", "a_x=1e9"), "line 3: a_x is 1e9"),
        (3, _wall(2, 0, 4, 5, 4).replace("height=2.7", "depth=2.7"), "line 3: .* lacks height"),
        (3, _wall(2, 0, 4, 5, 4).replace("height=2.7", "height=-1"), "line 3: height must be"),
        (3, _wall(2, 0, 4, 0, 4), "line 3: wall 2 has no length"),
        (3, _wall(1, 0, 4, 5, 4), "line 3: wall 1 was made before, in line 2"),
        (5, DOOR.replace("wall0_id=0", "wall0_id=8") + "width=1, height=2", "line 5: .* wall 8"),
        (4, _wall(3, 2, -1, 2, 5), "line 4: this wall crosses the one of line 1"),
    ],
)
def test_the_line_is_named(tmp_path: Path, line: int, text: str, fact: str) -> None:
    lines = _lines()
    lines[line - 1] = text
    with pytest.raises(FormatError, match=r"room\.txt, " + fact):
        import_room(_file(tmp_path, lines))


def test_files_that_are_no_room(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="has 2 walls"):
        import_room(_file(tmp_path, _lines()[:2]))
    with pytest.raises(InputError, match="more than 20000"):
        import_room(_file(tmp_path, ["#"] * 20_001))
    (tmp_path / "b.txt").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FormatError, match="not text"):
        import_room(tmp_path / "b.txt")
    with pytest.raises(InputError, match="does not exist"):
        import_room(tmp_path / "c.txt")
    (tmp_path / "long.txt").write_text("#" * 4_000_001)
    with pytest.raises(InputError, match="too large"):
        import_room(tmp_path / "long.txt")
