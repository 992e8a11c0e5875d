"""Scenes of other programs, read by Blender: known lamps come out, nothing of theirs runs."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from luxcore.errors import FormatError, InputError
from luxcore.imports import import_room
from luxcore.rooms.model import Room

pytestmark = pytest.mark.blender


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Scene files written by Blender itself."""
    folder = tmp_path_factory.mktemp("scenes")
    script = Path(__file__).with_name("make_scenes.py")
    run = [sys.executable, str(script), str(folder)]
    result = subprocess.run(run, capture_output=True, text=True, timeout=300, check=False)
    assert (folder / "inner" / "linked.blend").is_file(), result.stderr[-2000:]
    return folder


def _by_name(room: Room) -> dict:
    return {lamp.name: lamp for lamp in room.lamps}


def test_lights_of_a_blend(scenes: Path) -> None:
    imported = import_room(scenes / "lights.blend")
    lamps = _by_name(imported.room)
    assert set(lamps) == {"bulb", "beam", "panel"}
    assert lamps["bulb"].scale == pytest.approx((60, 30, 15), rel=1e-5)
    # A cone of 1 rad holds (1 - cos 0.5) / 2 of a sphere.
    assert lamps["beam"].scale == pytest.approx((0, 40 * (1 - math.cos(0.5)) / 2, 0), rel=1e-5)
    assert lamps["panel"].scale == pytest.approx((25 * math.pi,) * 3, rel=1e-5)
    assert lamps["panel"].position == pytest.approx((0, -1, 2.4), abs=1e-5)
    again = Room.from_json(json.loads(json.dumps(imported.room.to_json())))
    assert again == imported.room


@pytest.mark.parametrize("name", ["lights.gltf", "lights.glb"])
def test_gltf_lights_equal_those_of_the_blend(scenes: Path, name: str) -> None:
    lamps = _by_name(import_room(scenes / name).room)
    assert set(lamps) == {"bulb", "beam"}
    # Candela and back: Blender divides and multiplies by 683 lm/W and 4 pi.
    assert lamps["bulb"].scale == pytest.approx((60, 30, 15), rel=0.01)
    assert lamps["bulb"].position == pytest.approx((1, 0, 2), abs=1e-4)
    assert lamps["beam"].scale[1] == pytest.approx(40 * (1 - math.cos(0.5)) / 2, rel=0.02)


def test_usd_lights(scenes: Path) -> None:
    lamps = _by_name(import_room(scenes / "lights.usda").room)
    assert len(lamps) == 3
    places = sorted(lamp.position for lamp in lamps.values())
    assert np.array(places) == pytest.approx(
        np.array([[-1, 0.5, 2.2], [0, -1, 2.4], [1, 0, 2]]), abs=1e-3
    )


def test_emitting_surfaces_are_grouped(scenes: Path) -> None:
    imported = import_room(scenes / "glowing.blend")
    assert len(imported.room.lamps) == 2
    ball_m2 = 4 * math.pi * 0.05**2
    white, blue = imported.room.lamps
    # A polyhedron of 64 by 32 faces has 0.4 % less area than the ball.
    assert white.scale == pytest.approx(
        [5 * 10 * math.pi * ball_m2 * c for c in (1, 0.8, 0.6)], rel=0.01
    )
    assert blue.scale == pytest.approx((0, 0, 10 * math.pi * ball_m2), rel=0.01)
    emitting = [p for p in imported.room.parts if p.emits > 0]
    assert [p.lamp for p in emitting].count(white.id) == 5
    assert sum(p.emits for p in emitting if p.lamp == white.id) == pytest.approx(1)
    assert (white.kind, blue.kind) == ("ceiling", "wall")


def test_no_script_of_a_blend_runs(scenes: Path) -> None:
    assert len(import_room(scenes / "script.blend").room.lamps) == 1
    assert not (scenes / "script-ran").exists()
    assert not (scenes / "driver-ran").exists()


def test_links_out_of_the_folder_are_refused(scenes: Path) -> None:
    with pytest.raises(InputError, match=r"linked\.blend refers to .*lights\.blend.*outside"):
        import_room(scenes / "inner" / "linked.blend")


def test_a_file_that_is_no_blend(tmp_path: Path) -> None:
    (tmp_path / "a.blend").write_bytes(b"BLENDER-v500" + bytes(200))
    with pytest.raises(FormatError, match=r"a\.blend is not a readable scene"):
        import_room(tmp_path / "a.blend")


def test_red_green_and_blue_lamps(shared_data: Path) -> None:
    """A public test file: three point and three spot lights of pure colour, and a sun."""
    imported = import_room(shared_data / "lamps-import/tests/scenes/04_lights.blend")
    lamps = _by_name(imported.room)
    assert len(lamps) == 6
    for channel, name in enumerate(("Constant", "Linear", "Quadratic")):
        scale = np.array(lamps[f"Point_{name}"].scale)
        assert scale == pytest.approx(100 * np.eye(3)[channel], rel=1e-5)
    assert "sun" in imported.notes[0]
    assert len(imported.cameras) == 1


def test_a_folder_of_obj_files(shared_data: Path) -> None:
    imported = import_room(shared_data / "scene-cbox/scenes/cbox/meshes")
    assert [lamp.name for lamp in imported.room.lamps] == ["cbox_luminaire"]
    assert imported.room.lamps[0].kind == "ceiling"
    assert imported.room.height == pytest.approx(5.488, abs=1e-3)
    low = min(z for p in imported.room.parts for *_, z in p.shape.mesh().vertices)
    assert low == pytest.approx(0, abs=1e-6)
    metres = import_room(shared_data / "scene-cbox/scenes/cbox/meshes", unit_m=0.001)
    assert metres.room.height == pytest.approx(0.5488, abs=1e-4)


def test_an_imported_room_renders_like_the_original(shared_data: Path, tmp_path: Path) -> None:
    """Against a reference of 4096 samples of Cycles: one point light of 1000 W over a cube."""
    import cv2

    from luxcore.files.exr import read_exr, read_exr_image
    from luxcore.render.unit import render_view
    from luxcore.settings.render import RenderSettings

    folder = shared_data / "render-ignis/scenes/evaluation"
    imported = import_room(folder / "blender/box.blend")
    camera = imported.cameras[0].resized(64, 64)
    render_view(imported.room, camera, RenderSettings(spp=32, denoise="off"), tmp_path)
    light = read_exr(tmp_path / "0000.exr")["light_00"]
    ours = light * np.float32(imported.room.lamps[0].scale)
    reference = read_exr_image(folder / "references/ref-cycles-box-4096.exr")
    reference = cv2.resize(reference, (64, 64), interpolation=cv2.INTER_AREA)
    normal = read_exr(tmp_path / "0000.geometry.exr")["normal"]

    def face(direction: tuple[int, int, int]) -> np.ndarray:
        on = (normal @ np.float32(direction) > 0.99).astype(np.uint8)
        return cv2.erode(on, np.ones((5, 5), np.uint8)) > 0

    # The side that the lamp cannot reach shows what the reference's world adds everywhere.
    world = np.median(reference[face((0, -1, 0))])
    for direction in ((0, 0, 1), (1, 0, 0)):
        here = face(direction)
        ratio = np.median(ours[here]) / (np.median(reference[here]) - world)
        # The renderer's paint lacks the original's 4 % of gloss.
        assert ratio == pytest.approx(1, abs=0.1)
