"""Scenes on disk, mixes of lamps, and the commands over them."""

from __future__ import annotations

import json
import struct
from dataclasses import replace
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner, Result
from optim_room import Room, make_room, room_cameras

from luxcore.cameras import camera_to_nerfstudio
from luxcore.cli.export import command as export
from luxcore.cli.lamp_options import parse_lamp_settings
from luxcore.cli.relight import command as relight
from luxcore.cli.splat import command as splat
from luxcore.errors import FormatError, InputError
from luxcore.files.digests import file_digest
from luxcore.files.exr import read_exr_image
from luxcore.files.photos import read_photo
from luxcore.light.agx import agx
from luxcore.splats.ply import read_ply
from luxcore.splats.relighting import (
    FixedCamera,
    LampSetting,
    MovingCamera,
    mixing_weights,
    render_scene,
    solo,
)
from luxcore.splats.scene import Scene, SceneLamp, SceneTone, load_scene, save_scene

CAMERA = room_cameras(5, 45, 33)[2]


@pytest.fixture(scope="module")
def room() -> Room:
    return make_room(800)


@pytest.fixture(scope="module")
def scene(room: Room) -> Scene:
    lamps = (
        SceneLamp(0, "desk", True, (2.0, 1.0, 0.5)),
        SceneLamp(1, "floor", False, (1.0, 1.0, 1.0)),
    )
    tone = SceneTone(1.3, 0.001, 2.2)
    return Scene("box", room.gaussians, room.lights, lamps, (1.0, 0.9, 0.8), tone, 5)


@pytest.fixture
def folder(scene: Scene, tmp_path: Path) -> Path:
    save_scene(tmp_path / "scene", scene, [CAMERA, CAMERA])
    return tmp_path / "scene"


def test_scene_round_trip_is_lossless(scene: Scene, folder: Path) -> None:
    read = load_scene(folder)
    np.testing.assert_array_equal(read.radiance, scene.radiance)
    np.testing.assert_array_equal(read.gaussians.means, scene.gaussians.means)
    assert (read.lamps, read.tone, read.ambient_scale) == (
        scene.lamps, scene.tone, scene.ambient_scale,
    )  # fmt: skip
    save_scene(folder, replace(scene, metric=True), [CAMERA, CAMERA])
    assert (read.metric, load_scene(folder).metric) == (False, True)


def test_damage_version_and_mismatch_are_refused(folder: Path) -> None:
    about = json.loads((folder / "scene.json").read_text())
    raw = bytearray((folder / "lights.safetensors").read_bytes())
    raw[-1] ^= 1
    (folder / "lights.safetensors").write_bytes(raw)
    with pytest.raises(FormatError, match=r"lights\.safetensors is damaged"):
        load_scene(folder)
    (folder / "scene.json").write_text(json.dumps({**about, "version": 2}))
    with pytest.raises(FormatError, match="of version 2, this program reads 1"):
        load_scene(folder)
    (folder / "scene.json").write_text("[1, 2")
    with pytest.raises(FormatError, match=r"scene\.json is not readable JSON"):
        load_scene(folder)
    with pytest.raises(InputError, match="is not a scene"):
        load_scene(folder / "nowhere")


def test_missing_lamp_in_the_description_is_refused(folder: Path) -> None:
    about = json.loads((folder / "scene.json").read_text())
    about["lamps"].pop()
    (folder / "scene.json").write_text(json.dumps(about))
    with pytest.raises(FormatError, match=r"holds 3 lights, .* names 1 lamps"):
        load_scene(folder)


@pytest.mark.parametrize(
    ("damage", "fact"),
    [
        (lambda about: about["tone"].update(exposure=float("nan")), "exposure is NaN"),
        (lambda about: about["tone"].update(exposure=0), "exposure is 0"),
        (lambda about: about["tone"].update(gamma=float("inf")), "gamma is Infinity"),
        (lambda about: about["tone"].update(beta="dark"), 'beta is "dark"'),
        (lambda about: about["tone"].pop("beta"), "'beta'"),
        (lambda about: about["lamps"][1].update(scale=[1, 1, float("nan")]), "scale of lamp floor"),
        (lambda about: about["lamps"][1].update(on="no"), "on of lamp floor"),
        (lambda about: about["lamps"][0].update(index=-1), "index of lamp desk"),
        (lambda about: about.update(ambient_scale=[1, 10**400, 1]), "ambient_scale"),
        (lambda about: about.update(ambient_scale={"red": 1}), "ambient_scale"),
        (lambda about: about.update(views=float("inf")), "views is Infinity"),
        (lambda about: about.update(views=2.5), "views is 2.5"),
        (lambda about: about.update(tone=[1, 2, 3]), "usable"),
        (lambda about: about["lamps"][1].update(name="desk"), "two lights are called 'desk'"),
        (lambda about: about["lamps"][1].update(name="ambient"), "two lights are called 'ambient'"),
    ],
)
def test_numbers_that_are_none_name_the_file_and_the_fact(folder: Path, damage, fact: str) -> None:
    about = json.loads((folder / "scene.json").read_text())
    damage(about)
    (folder / "scene.json").write_text(json.dumps(about))
    with pytest.raises(FormatError, match=rf"scene\.json.*{fact}"):
        load_scene(folder)


@pytest.mark.parametrize(("kind", "size"), [("BF16", 2), ("F8_E4M3", 1), ("F64", 8), ("none", 1)])
def test_lights_of_another_type_are_refused(folder: Path, kind: str, size: int) -> None:
    count = 800 * 3 * 3 * size
    entry = {"dtype": kind, "shape": [800, 3, 3], "data_offsets": [0, count]}
    header = json.dumps({"radiance": entry}).encode()
    path = folder / "lights.safetensors"
    path.write_bytes(struct.pack("<Q", len(header)) + header + bytes(count))
    about = json.loads((folder / "scene.json").read_text())
    about["digests"][path.name] = file_digest(path)
    (folder / "scene.json").write_text(json.dumps(about))
    with pytest.raises(FormatError, match=r"lights\.safetensors.* radiance"):
        load_scene(folder)


def test_default_mix_is_the_photo(scene: Scene) -> None:
    np.testing.assert_allclose(mixing_weights(scene), [[1.0, 0.9, 0.8], [2.0, 1.0, 0.5], [0, 0, 0]])


def test_intensity_and_colour(scene: Scene) -> None:
    settings = {"desk": LampSetting(0.5, (1.0, 1.0, 1.0)), "floor": LampSetting(2.0)}
    weights = mixing_weights(scene, settings)
    luminance = 2.0 * 0.2126 + 0.7152 + 0.5 * 0.0722
    np.testing.assert_allclose(weights[1], 0.5 * luminance)
    np.testing.assert_allclose(weights[2], 2.0)


def test_light_is_linear(scene: Scene) -> None:
    """The picture of a mix is the mix of the pictures, and nothing is left when all is off."""
    names = ("ambient", "desk", "floor")
    settings = {"desk": LampSetting(0.3), "floor": LampSetting(1.7), "ambient": LampSetting(0.5)}
    camera = MovingCamera(scene)
    alone = sum(
        settings[name].intensity * camera.render(CAMERA, solo(scene, name)) for name in names
    )
    np.testing.assert_allclose(camera.render(CAMERA, settings), alone, atol=2e-6)
    dark = dict.fromkeys(names, LampSetting(0.0))
    assert not render_scene(scene, CAMERA, dark).any()


def test_fixed_and_moving_camera_agree(scene: Scene) -> None:
    settings = {"floor": LampSetting(0.4, (1.0, 0.5, 0.1))}
    fixed = FixedCamera(scene, CAMERA).render(settings)
    np.testing.assert_allclose(fixed, render_scene(scene, CAMERA, settings), atol=2e-6)


def test_unknown_lamp_names_the_nearest(scene: Scene) -> None:
    with pytest.raises(InputError, match=r"no lamp 'dask' \(nearest: desk\); it has ambient, desk"):
        mixing_weights(scene, {"dask": LampSetting()})


@pytest.mark.parametrize(
    ("option", "expected"),
    [
        ("desk=0.5", LampSetting(0.5)),
        ("desk=0.5,#ffffff", LampSetting(0.5, (1.0, 1.0, 1.0))),
        ("desk=#000000", LampSetting(1.0, (0.0, 0.0, 0.0))),
        ("a=b=2", LampSetting(2.0)),
    ],
)
def test_lamp_options(option: str, expected: LampSetting) -> None:
    assert list(parse_lamp_settings([option]).values()) == [expected]


@pytest.mark.parametrize(
    "option",
    [
        "desk",
        "=1",
        "desk=",
        "desk=x",
        "desk=-1",
        "desk=nan",
        "desk=1e99",
        "desk=#12",
        "d=1,2",
        "d=,",
    ],
)
def test_bad_lamp_options_are_quoted(option: str) -> None:
    with pytest.raises(InputError, match="--set"):
        parse_lamp_settings([option])


def invoke(command: click.Command, *arguments: str | Path) -> Result:
    return CliRunner().invoke(command, [str(a) for a in arguments])


def camera_file(folder: Path) -> Path:
    path = folder / "camera.json"
    path.write_text(json.dumps(camera_to_nerfstudio(CAMERA)))
    return path


def test_relight_writes_png_and_exr(scene: Scene, folder: Path, tmp_path: Path) -> None:
    camera = camera_file(tmp_path)
    for suffix in ("png", "exr"):
        out = tmp_path / f"x.{suffix}"
        result = invoke(relight, folder, "--set", "desk=0.5", "--camera", camera, "--out", out)
        assert result.exit_code == 0, result.output
    linear = read_exr_image(tmp_path / "x.exr")
    expected = render_scene(scene, CAMERA, {"desk": LampSetting(0.5)})
    np.testing.assert_allclose(linear, expected, atol=1e-6)
    shown = read_photo(tmp_path / "x.png")
    np.testing.assert_allclose(shown, agx(1.3 * expected), atol=0.51 / 255)


def test_relight_by_view_number(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "x.png"
    assert invoke(relight, folder, "--view", "1", "--out", out).exit_code == 0
    result = invoke(relight, folder, "--view", "7", "--out", tmp_path / "y.png")
    assert isinstance(result.exception, InputError)
    assert "views 0 to 1" in str(result.exception)
    assert not (tmp_path / "y.png").exists()


def test_bad_requests_write_nothing(folder: Path, tmp_path: Path) -> None:
    camera = camera_file(tmp_path)
    broken = tmp_path / "broken.json"
    broken.write_text('{"fl_x": 0, "w": 10, "h": 10, "transform_matrix": [[1]]}')
    out = tmp_path / "x.png"
    cases = [
        (folder, "--set", "dask=1", "--camera", camera, "--out", out),
        (folder, "--camera", broken, "--out", out),
        (folder, "--camera", tmp_path / "none.json", "--out", out),
        (folder, "--camera", camera, "--out", tmp_path / "x.jpg"),
        (tmp_path, "--camera", camera, "--out", out),
    ]
    for arguments in cases:
        assert isinstance(invoke(relight, *arguments).exception, InputError), arguments
    assert not out.exists()


def test_splat_render_shows_any_ply(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "x.exr"
    file, camera = folder / "splats.ply", camera_file(tmp_path)
    result = invoke(splat, "render", file, "--camera", camera, "--out", out)
    assert result.exit_code == 0, result.output
    image = read_exr_image(out)
    assert image.shape == (33, 45, 3)
    assert image.max() > 0.1


def test_export_bakes_a_mix(folder: Path, tmp_path: Path) -> None:
    assert invoke(export, folder, "--set", "desk=0", "--out", tmp_path / "a.ply").exit_code == 0
    assert invoke(export, folder, "--out", tmp_path / "b.ply").exit_code == 0
    a, b = read_ply(tmp_path / "a.ply"), read_ply(tmp_path / "b.ply")
    np.testing.assert_array_equal(a.means, b.means)
    assert (a.sh <= b.sh + 1e-6).all()
    assert (a.sh < b.sh).any()


def test_export_of_every_lamp(folder: Path, tmp_path: Path) -> None:
    assert invoke(export, folder, "--lamps", "--out", tmp_path / "all").exit_code == 0
    names = sorted(path.name for path in (tmp_path / "all").iterdir())
    assert names == ["00_ambient.ply", "01_desk.ply", "02_floor.ply"]
