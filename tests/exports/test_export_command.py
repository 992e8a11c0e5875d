"""`lux export`: each format through the command, read back by the tools that it is for."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import OpenImageIO
import pycolmap
import pytest
from click.testing import CliRunner, Result
from PIL import Image
from small_scene import write_small_scene

from luxcore.cameras import Camera
from luxcore.cli.export import FORMATS
from luxcore.cli.export import command as export
from luxcore.cli.relight import command as relight
from luxcore.errors import FormatError, InputError
from luxcore.splats.relighting import LampSetting, baked_gaussians, render_scene, solo
from luxcore.splats.scene import Scene, save_scene

MIX = ["--set", "floor=0.5,#ff8000", "--set", "ambient=0.25"]


@pytest.fixture
def written(tmp_path: Path) -> tuple[Path, Scene, list[Camera]]:
    return tmp_path / "scene", *write_small_scene(tmp_path / "scene")


def run(*arguments: object) -> Result:
    done = CliRunner().invoke(export, [str(a) for a in arguments])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code == 0, done.output
    return done


def test_help_lists_every_format_on_a_line_of_its_own() -> None:
    lines = CliRunner().invoke(export, ["--help"]).output.splitlines()
    for name, form in FORMATS.items():
        assert f"{name} {form.about}" in [" ".join(line.split()) for line in lines]


def test_exr_in_openimageio_and_openexr(tmp_path: Path, written) -> None:
    folder, scene, cameras = written
    out = tmp_path / "layers.exr"
    run(folder, "--format", "exr", "--view", 1, "--out", out)
    image = OpenImageIO.ImageInput.open(str(out))
    names, layers = [], {}
    while image.seek_subimage(len(names), 0):
        names.append(image.spec().getattribute("oiio:subimagename"))
        layers[names[-1]] = image.read_image(format="float")
    assert names == ["ambient", "desk lamp", "floor"]
    with OpenEXR.File(str(out)) as file:
        assert [part.name() for part in file.parts] == names
    # Linear light adds up; the lamp that was off has a layer and no share in the photo.
    photo = render_scene(scene, cameras[1])
    assert layers["ambient"] + layers["desk lamp"] == pytest.approx(photo, abs=1e-5)
    alone = render_scene(scene, cameras[1], solo(scene, "floor"))
    assert layers["floor"] == pytest.approx(alone, abs=1e-6)
    assert alone.max() > 0.05


def test_exr_of_a_mix(tmp_path: Path, written) -> None:
    folder, scene, cameras = written
    run(folder, "--format", "exr", "--out", tmp_path / "a.exr", "--set", "desk lamp=0.5")
    with OpenEXR.File(str(tmp_path / "a.exr")) as file:
        desk = file.parts[1].channels["RGB"].pixels
    half = {"ambient": LampSetting(0.0), "floor": LampSetting(0.0), "desk lamp": LampSetting(0.5)}
    assert desk == pytest.approx(render_scene(scene, cameras[0], half), abs=1e-6)


@pytest.mark.parametrize("form", ["ply", "spz", "glb"])
def test_a_set_with_one_file_per_lamp(tmp_path: Path, written, form: str) -> None:
    folder, scene, _ = written
    assert (
        "3 files of 60 Gaussians"
        in run(folder, "--format", form, "--lamps", "--out", tmp_path / "set").output
    )
    files = sorted(path.name for path in (tmp_path / "set").iterdir())
    assert files == [f"00_ambient.{form}", f"01_desk_lamp.{form}", f"02_floor.{form}"]
    assert len({path.read_bytes() for path in (tmp_path / "set").iterdir()}) == 3
    if form == "ply":
        from plyfile import PlyData

        red = PlyData.read(str(tmp_path / "set" / "02_floor.ply"))["vertex"]["f_dc_0"]
        ours = baked_gaussians(scene, solo(scene, "floor")).sh[:, 0, 0]
        np.testing.assert_array_equal(red, ours)


@pytest.mark.parametrize("form", ["colmap", "colmap-text"])
def test_relit_photos_and_cameras_in_colmap(tmp_path: Path, written, form: str) -> None:
    folder, scene, cameras = written
    run(folder, "--format", form, "--out", tmp_path / "out", *MIX)
    sparse = tmp_path / "out" / "sparse" / "0"
    suffix = ".txt" if form == "colmap-text" else ".bin"
    assert {path.suffix for path in sparse.iterdir()} == {suffix}
    model = pycolmap.Reconstruction(sparse)
    images = sorted(model.images.values(), key=lambda image: image.name)
    for image, camera in zip(images, cameras, strict=True):
        assert np.abs(image.cam_from_world().matrix() - camera.viewmat[:3]).max() < 1e-9
        assert np.abs(image.camera.calibration_matrix() - camera.intrinsics).max() < 1e-9
    points = np.stack([model.points3D[i].xyz for i in sorted(model.points3D)])
    assert points == pytest.approx(scene.gaussians.means, abs=1e-5)

    CliRunner().invoke(
        relight, [str(folder), "--view", "1", "--out", str(tmp_path / "b.png"), *MIX]
    )
    theirs = np.asarray(Image.open(tmp_path / "out" / "images" / images[1].name), int)
    assert np.abs(theirs - np.asarray(Image.open(tmp_path / "b.png"), int)).max() <= 1


def test_relit_photos_and_cameras_in_nerfstudio(tmp_path: Path, written) -> None:
    folder, _, cameras = written
    run(folder, "--format", "nerfstudio", "--out", tmp_path / "out", *MIX)
    transforms = json.loads((tmp_path / "out" / "transforms.json").read_text())
    assert transforms["camera_model"] == "OPENCV"
    for frame, camera in zip(transforms["frames"], cameras, strict=True):
        # nerfstudio's camera looks along its -z.
        forward = -np.array(frame["transform_matrix"])[:3, 2]
        assert forward == pytest.approx(camera.c2w[:3, 2])
        assert Image.open(tmp_path / "out" / frame["file_path"]).size == (frame["w"], frame["h"])
    assert (tmp_path / "out" / transforms["ply_file_path"]).is_file()


def test_a_capture_gives_its_own_photos(tmp_path: Path, written) -> None:
    folder, _, _ = written
    run(folder, "--format", "nerfstudio", "--out", tmp_path / "first")
    from luxcore.capture import ingest
    from luxcore.settings.capture import CaptureSettings

    ingest(tmp_path / "first", tmp_path / "capture", CaptureSettings(min_views=2), 0)
    run(tmp_path / "capture", "--format", "colmap", "--out", tmp_path / "second")
    names = [
        sorted(p.name for p in (tmp_path / n / "images").iterdir()) for n in ("first", "second")
    ]
    assert names[0] == names[1]
    for name in names[0]:
        paths = [tmp_path / n / "images" / name for n in ("first", "second")]
        assert np.array_equal(*(np.asarray(Image.open(path)) for path in paths))
    with pytest.raises(InputError, match="is a capture, whose photos take no --set"):
        run(tmp_path / "capture", "--format", "colmap", "--out", tmp_path / "x", *MIX)


@pytest.mark.parametrize(
    ("arguments", "fact"),
    [
        (["--format", "spz", "--out", "x.ply"], r"x\.ply must end in \.spz"),
        (["--format", "exr", "--lamps", "--out", "x.exr"], "--lamps is for ply, spz, glb"),
        (["--format", "glb", "--view", "0", "--out", "x.glb"], "--view is for exr, not for glb"),
        (["--lamps", "--set", "floor=1", "--out", "x"], "takes no --set"),
        (["--set", "flor=1", "--out", "x.ply"], r"no lamp 'flor' \(nearest: floor\)"),
        (["--format", "exr", "--view", "7", "--out", "x.exr"], "has views 0 to 1, asked for 7"),
    ],
)
def test_what_makes_no_sense_is_refused(
    tmp_path: Path, written, monkeypatch: pytest.MonkeyPatch, arguments: list[str], fact: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=fact):
        run(written[0], *arguments)
    assert [path.name for path in tmp_path.iterdir()] == ["scene"]


def test_the_scene_itself_is_not_replaced(tmp_path: Path, written) -> None:
    folder = written[0]
    held = (folder / "splats.ply").read_bytes()
    (tmp_path / "link").symlink_to(folder)
    for out in (folder / "splats.ply", tmp_path / "link" / "splats.ply"):
        with pytest.raises(InputError, match="is a file of the scene itself"):
            run(folder, "--out", out)
    assert (folder / "splats.ply").read_bytes() == held
    for _ in range(2):
        run(folder, "--out", folder / "mix.ply")


def test_a_folder_of_other_models_is_not_replaced(tmp_path: Path, written) -> None:
    mine = tmp_path / "models" / "01_chair.ply"
    mine.parent.mkdir()
    mine.write_text("kept")
    with pytest.raises(InputError, match=r"01_chair\.ply, which would be lost"):
        run(written[0], "--lamps", "--out", mine.parent)
    assert mine.read_text() == "kept"
    for _ in range(2):
        run(written[0], "--lamps", "--out", tmp_path / "set")


def test_a_scene_without_gaussians_or_views_is_one_sentence(tmp_path: Path, written) -> None:
    scene = written[1]
    nothing = replace(scene, gaussians=scene.gaussians.take(np.zeros(60, bool)), views=0)
    save_scene(tmp_path / "empty", replace(nothing, radiance=scene.radiance[:0]), written[2])
    with pytest.raises(InputError, match="0 Gaussians"):
        run(tmp_path / "empty", "--format", "glb", "--out", tmp_path / "x.glb")
    with pytest.raises(InputError, match="has no views"):
        run(tmp_path / "empty", "--format", "nerfstudio", "--out", tmp_path / "x")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["empty", "scene"]


def _newer(folder: Path) -> None:
    about = json.loads((folder / "scene.json").read_text())
    (folder / "scene.json").write_text(json.dumps({**about, "version": 2}))


def _altered(folder: Path) -> None:
    raw = bytearray((folder / "splats.ply").read_bytes())
    raw[-5] ^= 1
    (folder / "splats.ply").write_bytes(raw)


def _incomplete(folder: Path) -> None:
    (folder / "lights.safetensors").unlink()


@pytest.mark.parametrize("program", [export, relight])
@pytest.mark.parametrize(
    ("spoil", "fact"),
    [
        (_newer, r"scene\.json is of version 2, this program reads 1"),
        (_altered, r"splats\.ply is damaged: scene\.json lists another sha256"),
        (_incomplete, r"lights\.safetensors does not exist, scene\.json lists it"),
    ],
)
def test_a_spoilt_scene_is_one_sentence(tmp_path: Path, written, program, spoil, fact: str) -> None:
    folder = written[0]
    spoil(folder)
    out = tmp_path / ("x.ply" if program is export else "x.png")
    error = CliRunner().invoke(program, [str(folder), "--out", str(out)]).exception
    assert isinstance(error, FormatError)
    assert str(error).count("\n") == 0
    with pytest.raises(FormatError, match=fact):
        raise error
    assert not out.exists()
