"""`lux render --import FILE`: rooms from elsewhere in the public layout, known lamps apart."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from luxcore.cli.render import command
from luxcore.data.panorama import directions_of_pixels
from luxcore.data.public_files import FolderFiles
from luxcore.data.public_reader import PublicScene, open_scenes
from luxcore.errors import FormatError, InputError
from luxcore.imports.scene_file import SceneData, SceneMesh
from luxcore.imports.scene_room import scene_to_room
from luxcore.imports.standpoints import APART_M, CLEARANCE_M, standpoints

ROOM = """make_wall, id=0, a_x=0, a_y=0, a_z=0, b_x=4, b_y=0, b_z=0, height=2.6
make_wall, id=1, a_x=4, a_y=0, a_z=0, b_x=4, b_y=3, b_z=0, height=2.6
make_wall, id=2, a_x=4, a_y=3, a_z=0, b_x=0, b_y=3, b_z=0, height=2.6
make_wall, id=3, a_x=0, a_y=3, a_z=0, b_x=0, b_y=0, b_z=0, height=2.6
"""
ROWS = 96


def imported(out: Path, *files: Path, rows: int = 16) -> Result:
    """The command in this process, so that all tests share one Blender."""
    named = [word for file in files for word in ("--import", str(file))]
    small = ("--size", f"{2 * rows}x{rows}", "--spp", "4", "--views", "1")
    here = CliRunner(env={"LUX_EXECUTOR": "serial"})
    return here.invoke(command, [*named, *small, "--out", str(out)])


@pytest.fixture(scope="module")
def known(shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> list[PublicScene]:
    """Two public files whose lamps are known: three colours over a plane, a bulb over a cube."""
    out = tmp_path_factory.mktemp("known")
    colours = shared_data / "lamps-import/tests/scenes/04_lights.blend"
    cube = shared_data / "render-ignis/scenes/evaluation/blender/box.blend"
    result = imported(out, colours, cube, rows=ROWS)
    assert result.exit_code == 0, result.output
    assert "sun Directional is left out" in result.stderr
    return open_scenes(out)


def olats(scene: PublicScene) -> dict[str, np.ndarray]:
    """Each lamp's own image, by the lamp's name in the file."""
    found = {}
    for number in scene.olat_passes:
        (lamp,) = (light for light in scene.meta(number)["lighting"] if light["update"])
        found[lamp["id"]] = scene.exr(number, 1, "rgb_olat.exr")
    return found


@pytest.mark.blender
def test_every_channel_is_the_light_of_the_lamps_of_its_colour(known: list[PublicScene]) -> None:
    """One point and one spot light in each of pure red, green and blue."""
    scene = known[0]
    alone = olats(scene)
    assert len(alone) == 6
    full = scene.exr(0, 1, "rgb_mix.exr")
    for channel, colour in enumerate(("Constant", "Linear", "Quadratic")):
        mine = [light for name, light in alone.items() if name.endswith(colour)]
        others = [c for c in range(3) if c != channel]
        assert len(mine) == 2
        assert not any(light[..., others].any() for light in mine)
        # The beams of the spots are too narrow to be hit at this size.
        assert alone[f"Point_{colour}"][..., channel].max() > 0
        # The mix is stored in half precision: 2^-11 of a value, 2^-24 near zero.
        total = np.sum([light[..., channel] for light in mine], axis=0)
        assert full[..., channel] == pytest.approx(total, rel=2**-10, abs=2**-22)


@pytest.mark.blender
def test_a_lamp_over_a_cube_is_as_bright_as_the_inverse_square_says(
    known: list[PublicScene],
) -> None:
    """A bulb of 1000 W over a cube of albedo 0.8, seen from the file's camera."""
    (light,) = olats(known[1]).values()
    view = known[1].read_view(1)
    rays = directions_of_pixels(ROWS, 2 * ROWS) @ view.c2w[:3, :3].T
    points = view.c2w[:3, 3] + rays * view.ray_distance_m[..., None]
    # Away from the edges of the top, where pixels and the denoiser see the black beside it.
    top = (np.abs(points[..., :2]) < 0.6).all(axis=2) & (np.abs(points[..., 2] - 2) < 0.05)
    assert top.sum() >= 8
    toward = np.array(view.lamps[0].position) - points[top]
    distance = np.linalg.norm(toward, axis=1)
    irradiance = 1000 / (4 * np.pi) * toward[:, 2] / distance**3
    ratio = light[top].mean(axis=1) / (0.8 / np.pi * irradiance)
    # The rim of so small a bulb, half in and half out of its mask, rules the factor that gives
    # the denoiser's losses back: it is undone here.
    files = known[1].files
    assert isinstance(files, FolderFiles)
    about = files.folder.parent / "statistics" / f"{files.scene_id}.json"
    factor = json.loads(about.read_text())["views"][0]["lamps"][0]["energy_factor"]
    # Four samples are noisy; a wrong unit would be wrong by 3 or more.
    assert np.median(ratio) / factor == pytest.approx(1, abs=0.35)


@pytest.mark.blender
def test_each_kind_of_file_renders(tmp_path: Path) -> None:
    script = Path(__file__).with_name("make_scenes.py")
    run = [sys.executable, str(script), str(tmp_path)]
    subprocess.run(run, capture_output=True, timeout=300, check=False)
    (tmp_path / "aria.txt").write_text(ROOM)
    names = ("lights.blend", "lights.glb", "lights.usda", "aria.txt")
    result = imported(tmp_path / "out", *(tmp_path / name for name in names))
    assert result.exit_code == 0, result.output
    scenes = open_scenes(tmp_path / "out")
    assert [scene.scene_id for scene in scenes] == ["000000", "000001", "000002", "000003"]
    assert [len(scene.olat_passes) for scene in scenes] == [3, 2, 3, 1]
    for scene in scenes:
        assert all(light.max() > 0 for light in olats(scene).values())


@pytest.mark.parametrize(
    ("name", "text", "fact"),
    [
        ("room.txt", ROOM + "make_wal, id=9\n", r"room\.txt, line 5: unknown command 'make_wal'"),
        ("room.txt", ROOM.replace("height=2.6", "height=tall", 1), r"room\.txt, line 1: height is"),
        ("room.gltf", "{", r"room\.gltf is not readable glTF"),
        ("room.xyz", "", r"room\.xyz is none of"),
    ],
)
def test_bad_files_are_one_sentence(tmp_path: Path, name: str, text: str, fact: str) -> None:
    (tmp_path / name).write_text(text)
    result = imported(tmp_path / "out", tmp_path / name)
    assert isinstance(result.exception, InputError | FormatError)
    assert result.exception.exit_code == 2
    with pytest.raises(InputError, match=fact):
        raise result.exception
    assert not (tmp_path / "out").exists()


def test_a_missing_file_and_no_choice(tmp_path: Path) -> None:
    result = imported(tmp_path / "out", tmp_path / "none.blend")
    assert isinstance(result.exception, InputError)
    both = CliRunner().invoke(command, ["--rooms", "1", "--import", "a.txt", "--out", "x"])
    assert both.exit_code == 2
    assert "--rooms N or --import FILE" in both.output


def box(low: tuple[float, ...], high: tuple[float, ...]) -> np.ndarray:
    """The twelve triangles of a box, in metres."""
    corners = np.array(
        [[(low, high)[b][a] for a, b in enumerate(bits)] for bits in np.ndindex(2, 2, 2)]
    )
    quads = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
    return np.array([corners[[q[0], q[k], q[k + 1]]] for q in quads for k in (1, 2)])


def test_standpoints_are_free_and_apart() -> None:
    room = box((0.0, 0.0, 0.0), (6.0, 4.0, 2.6))
    pillar = box((2.5, 1.5, 0.0), (3.5, 2.5, 2.6))
    points = standpoints(np.concatenate([room, pillar]), 1.5, [], 4)
    assert len(points) == 4
    for number, point in enumerate(points):
        assert point[2] == 1.5
        from_walls = min(point[0], 6 - point[0], point[1], 4 - point[1])
        assert from_walls >= CLEARANCE_M - 0.05
        assert max(abs(point[0] - 3) - 0.5, abs(point[1] - 2) - 0.5) >= CLEARANCE_M - 0.05
        assert all(np.linalg.norm(point - other) >= APART_M for other in points[:number])


def test_the_cameras_of_the_file_come_first_where_they_are_free() -> None:
    room = box((0.0, 0.0, 0.0), (6.0, 4.0, 2.6))
    outside, free, at_a_wall = np.array([[9.0, 0.0, 1.0], [1.0, 1.0, 1.2], [0.1, 2.0, 1.2]])
    first, second = standpoints(room, 1.5, [outside, free, at_a_wall], 2)
    assert first == pytest.approx(free)
    assert np.linalg.norm(second - first) > 3
    # Where no camera is inside, one outside is what the file wants to be seen from.
    assert standpoints(room, 1.5, [outside, 10 * outside], 2)[0] == pytest.approx(outside)


def shining(*watts: tuple[float, float, float], **lens: object) -> SceneData:
    """A sloping surface that shines in as many colours, side by side, and one camera."""
    corners = np.array([[x, y, z] for x, z in ((0, 0), (2, 1), (4, 2.6)) for y in (0, 3)], float)
    faces = ((0, 1, 3, 2), (2, 3, 5, 4))[: len(watts)]
    plain = {"color": [0.8] * 3, "roughness": 0.5, "metallic": 0.0, "transmission": 0.0, "ior": 1.5}
    materials = tuple({"name": f"m{i}", "emission": list(w), **plain} for i, w in enumerate(watts))
    mesh = SceneMesh("m", None, corners, faces, np.arange(len(watts)), materials)
    camera = {"name": "c", "perspective": True, "angle": 1.0, "fit": "AUTO", "size": [64, 48]}
    seen = {"matrix": np.eye(4).tolist(), "shift": [0.0, 0.0], **camera, **lens}
    return SceneData(Path("a.blend"), (mesh,), (), (seen,), 1.0)


@pytest.mark.parametrize(
    "parent", [np.eye(3), np.diag([-2.0, 2, 2]), np.eye(3) + 0.2 * np.eye(3, k=1)]
)
def test_a_camera_under_a_parent_that_bends_space_is_a_rotation(parent: np.ndarray) -> None:
    """Blender allows parents that mirror or skew; the camera looks where it did."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = parent, (1, 1, 1)
    (seen,) = scene_to_room(shining((5.0, 5.0, 5.0), matrix=matrix.tolist())).cameras
    assert seen.c2w[:3, :3] @ seen.c2w[:3, :3].T == pytest.approx(np.eye(3))
    assert seen.c2w[:3, 2] == pytest.approx(-parent[:, 2] / np.linalg.norm(parent[:, 2]))
    assert seen.centre == pytest.approx([1, 1, 1])


def test_lamps_of_one_mesh_have_names_of_their_own() -> None:
    lamps = scene_to_room(shining((5.0, 0.0, 0.0), (0.0, 5.0, 0.0))).room.lamps
    assert sorted(lamp.name for lamp in lamps) == ["m_0", "m_1"]
    (lamp,) = scene_to_room(shining((5.0, 0.0, 0.0))).room.lamps
    assert lamp.name == "m"


def test_a_cupboard_still_has_one_standpoint() -> None:
    assert len(standpoints(box((0.0, 0.0, 0.0), (0.4, 0.4, 0.5)), 0.3, [], 4)) == 1
