"""Rooms from seeds: what every room must keep, over many of them."""

from __future__ import annotations

import json
import math
from collections import Counter
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from luxcore.errors import FormatError, InputError
from luxcore.render.paths import obstacles, walk
from luxcore.rooms import Room, generate_room
from luxcore.rooms.batch import demo_room, read_room, room_seeds, write_rooms
from luxcore.rooms.dice import stream
from luxcore.rooms.plan import draw_plan
from luxcore.settings.rooms import DEMO_SEED_BASE, TEST_SEED_BASE, RoomsSettings

SETTINGS = RoomsSettings()
SEEDS = range(40)


@pytest.fixture(scope="module")
def rooms() -> list[Room]:
    return [generate_room(seed, SETTINGS) for seed in SEEDS]


def test_json_round_trip(rooms: list[Room]) -> None:
    for room in rooms[:10]:
        assert Room.from_json(json.loads(json.dumps(room.to_json()))) == room


def test_alone_and_in_a_batch_are_the_same(rooms: list[Room]) -> None:
    assert generate_room(37, SETTINGS) == rooms[37]


def test_one_to_six_lamps_and_one_is_on(rooms: list[Room]) -> None:
    for room in rooms:
        assert 1 <= len(room.lamps) <= 6
        assert any(lamp.on for lamp in room.lamps)
        assert [lamp.id for lamp in room.lamps] == list(range(len(room.lamps)))
    assert any(not lamp.on for room in rooms for lamp in room.lamps)


def test_every_lamp_gives_all_of_its_light(rooms: list[Room]) -> None:
    for room in rooms:
        given = [0.0] * len(room.lamps)
        for part in room.parts:
            if part.emits:
                assert part.lamp is not None
                given[part.lamp] += part.emits
        for spot in room.spots:
            given[spot.lamp] += spot.emits
        # Shares are rounded to five digits, at most seven of them a lamp.
        assert given == pytest.approx([1.0] * len(given), abs=1e-4)


def test_lamps_hang_inside_the_room(rooms: list[Room]) -> None:
    for room in rooms:
        xs, ys = zip(*room.outline, strict=True)
        for lamp in room.lamps:
            x, y, z = lamp.position
            assert min(xs) < x < max(xs)
            assert min(ys) < y < max(ys)
            assert 0 < z < room.height


def test_cameras_are_at_eye_height_and_in_nothing(rooms: list[Room]) -> None:
    for room in rooms[:15]:
        boxes = obstacles(room)
        for point in room.viewpoints:
            assert 1.3 <= point[2] <= 1.75
            inside = ((np.array(point) > boxes.low) & (np.array(point) < boxes.high)).all(axis=1)
            # The slab of a sloping ceiling is turned: its axis-aligned box reaches into the room.
            names = [room.parts[k].name for k in np.flatnonzero(inside)]
            assert [n for n in names if n != "ceiling"] == []
        pairs = [(a, b) for a in room.viewpoints for b in room.viewpoints if a < b]
        assert all(math.dist(a, b) > 0.05 for a, b in pairs)


def test_every_material_is_known(rooms: list[Room]) -> None:
    for room in rooms:
        assert {part.material for part in room.parts} <= set(room.materials)
        for material in room.materials.values():
            assert all(0 <= c <= 1 for c in (*material.color, *material.color2))


def test_the_rooms_vary(rooms: list[Room]) -> None:
    uses = Counter(room.use for room in rooms)
    designs = {lamp.design for room in rooms for lamp in room.lamps}
    corners = {len(room.outline) for room in rooms}
    assert len(uses) >= 5
    assert len(designs) >= 15
    assert corners == {4, 6, 8}
    assert {bool(room.openings) for room in rooms} == {True, False}
    assert any(material.kind == "mirror" for room in rooms for material in room.materials.values())


def test_no_environment_without_an_opening(rooms: list[Room]) -> None:
    for room in rooms:
        assert (room.environment is not None) == bool(room.openings)


def test_plans_hold_what_their_outline_holds() -> None:
    for seed in range(40):
        plan = draw_plan(stream(seed, "plan"))
        corners = np.array(plan.outline)
        ahead = np.roll(corners, -1, axis=0)
        area = 0.5 * float((corners[:, 0] * ahead[:, 1] - corners[:, 1] * ahead[:, 0]).sum())
        # Positive: counter-clockwise, so walls face into the room.
        assert area == pytest.approx(sum(rect.area for rect in plan.rects), rel=1e-6)


def test_seed_ranges_never_meet() -> None:
    seeds = room_seeds(RoomsSettings(train=1000, test=90_000, first_seed=TEST_SEED_BASE - 1000))
    assert max(seeds["train"]) < min(seeds["test"])
    assert max(seeds["test"]) < DEMO_SEED_BASE <= min(seeds["demo"])
    with pytest.raises(InputError, match="held-out"):
        room_seeds(RoomsSettings(train=1001, first_seed=TEST_SEED_BASE - 1000))


def test_batch_on_disk(tmp_path: Path) -> None:
    write_rooms(tmp_path, RoomsSettings(train=2, test=1))
    assert read_room(tmp_path / "train" / "0001.json") == generate_room(1, SETTINGS)
    assert read_room(tmp_path / "test" / "0000.json").seed == TEST_SEED_BASE
    demo = read_room(tmp_path / "demo" / "demo.json")
    assert demo == demo_room(SETTINGS)
    assert all(lamp.on for lamp in demo.lamps)
    assert 2 <= len(demo.lamps) <= 3


def test_demo_walk_stays_in_the_open_and_overlaps() -> None:
    room = demo_room(SETTINGS)
    cameras = walk(room, 24, 72.0, 320, 240)
    boxes = obstacles(room)
    steps = [float(np.linalg.norm(a.centre - b.centre)) for a, b in pairwise(cameras)]
    assert len(cameras) == 24
    assert not any(boxes.blocks(camera.centre) for camera in cameras)
    assert max(steps) < 0.3
    assert float(np.linalg.norm(cameras[0].centre - cameras[11].centre)) > 1.5


@pytest.mark.parametrize("damage", ["version", "lamps", "shape"])
def test_damaged_room_is_one_sentence(tmp_path: Path, damage: str) -> None:
    value = generate_room(0, SETTINGS).to_json()
    if damage == "version":
        value["version"] = 99
    elif damage == "lamps":
        del value["lamps"]
    else:
        value["parts"][0]["shape"]["type"] = "Teapot"
    path = tmp_path / "room.json"
    path.write_text(json.dumps(value))
    with pytest.raises(FormatError, match=r"room\.json"):
        read_room(path)


def test_hdri_folder_without_pictures(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no \.exr or"):
        generate_room(0, RoomsSettings(hdri_folder=str(tmp_path)))
