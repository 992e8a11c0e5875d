"""The public layout: written, read back, read by OpenCV as its own tools do, packed into shards."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

sys.path.insert(0, str(Path(__file__).parent))
from analytic import panorama, perspective

from luxcore.cameras import camera_from_nerfstudio, look_at
from luxcore.data.compact import as_taken, load_rendered, save_rendered
from luxcore.data.convert import compact_to_public, export_photos, public_to_compact
from luxcore.data.crops import ViewSource
from luxcore.data.multiview import MultiViewSets
from luxcore.data.panorama import view_rotation
from luxcore.data.public_names import mask_colours, paint_masks, pick_mask
from luxcore.data.public_reader import open_scenes, public_views
from luxcore.data.public_writer import write_scene, write_shards
from luxcore.data.rotations import matrix_from_quaternion, quaternion_from_matrix
from luxcore.data.training import SingleViewSamples
from luxcore.errors import FormatError, InputError
from luxcore.files.exr import read_exr
from luxcore.light.agx import agx

HALF = 2.0**-11


@pytest.fixture(scope="module")
def scene_root(tmp_path_factory) -> Path:
    root = tmp_path_factory.mktemp("public")
    write_scene(root, "000000", [panorama(height=32), panorama((4.0, 3.0, 1.4), height=32)])
    return root


def test_every_file_of_the_layout_is_there(scene_root):
    names = {p.name for p in (scene_root / "000000").iterdir()}
    for view in ("0001", "0002"):
        for kind in (
            "depth.exr", "normal.png", "diffcol.jpg", "transind.jpg", "lgt_obj.png", "lgt_src.png",
            "window.png", "rgb_mix.exr", "rgb_ldr_mix.png",
        ):  # fmt: skip
            assert f"0000.{view}.{kind}" in names
        assert {f"1000.{view}.rgb_bg.exr", f"1000.{view}.rgb_ldr_bg.png"} <= names
        assert {f"1003.{view}.rgb_olat.exr", f"1003.{view}.rgb_ldr_olat.png"} <= names
        assert f"0003.{view}.rgb_mix.exr" in names
    assert {"0000.meta.json", "0003.meta.json", "1000.meta.json", "1003.meta.json"} <= names
    assert len(names) == 2 * (7 + 2 * 4 + 2 + 2 * 3) + 8


def test_full_mix_is_background_plus_olats_as_stored(scene_root):
    [scene] = open_scenes(scene_root)
    for view in scene.views:
        background = scene.exr(1000, view, "rgb_bg.exr")
        olats = [scene.exr(number, view, "rgb_olat.exr") for number in scene.olat_passes]
        full = scene.exr(0, view, "rgb_mix.exr")
        assert np.allclose(full, background + sum(olats), rtol=HALF, atol=1e-7)


def test_mixes_are_what_their_metadata_say(scene_root):
    [scene] = open_scenes(scene_root)
    for mix in scene.mix_passes:
        view = scene.read_view(1, mix)
        assert np.allclose(as_taken(view), scene.exr(mix, 1, "rgb_mix.exr"), rtol=2e-3, atol=1e-6)
    powers = [[light["power"] for light in scene.meta(m)["lighting"]] for m in range(4)]
    assert len({tuple(p) for p in powers}) == 4


def test_metadata_are_complete(scene_root):
    [scene] = open_scenes(scene_root)
    about = scene.meta(1002)
    assert set(about) >= {"scene_mod", "lighting", "camera_pose", "blender_cfg", "envmap"}
    assert [light["update"] for light in about["lighting"]] == [False, True, False]
    assert all(max(light["color"]) == pytest.approx(1) for light in about["lighting"])
    assert len(about["camera_pose"]) == 2
    assert len(about["camera_pose"][0]["rotation"]) == 4
    assert not any(light["update"] for light in scene.meta(0)["lighting"])
    assert about["blender_cfg"]["cam_type"] == "PANO"


def test_view_comes_back(scene_root):
    original = panorama(height=32)
    [scene] = open_scenes(scene_root)
    view = scene.read_view(1, mix=1)
    assert np.allclose(as_taken(view), as_taken(original), rtol=2e-3, atol=1e-5)
    contribution = original.lights * original.scale[:, None, None]
    assert np.allclose(view.lights, contribution, rtol=1e-6)
    assert np.array_equal(view.on, original.on)
    assert np.array_equal(view.ray_distance_m, original.ray_distance_m)
    assert np.allclose(view.c2w, original.c2w, atol=1e-12)
    assert np.allclose(view.normal, original.normal, atol=0.01)
    assert np.abs(view.albedo - original.albedo).mean() < 0.02
    assert np.array_equal(view.masks["emitter"], original.masks["emitter"])
    assert view.exposure == original.exposure


def test_exr_encoding_is_the_layouts(scene_root):
    import OpenEXR

    folder = scene_root / "000000"
    for name, channels, dtype in (
        ("0000.0001.depth.exr", 1, np.float32),
        ("1001.0001.rgb_olat.exr", 3, np.float32),
        ("1000.0001.rgb_bg.exr", 4, np.float16),
        ("0002.0001.rgb_mix.exr", 4, np.float16),
    ):
        with OpenEXR.File(str(folder / name), separate_channels=True) as file:
            pixels = [c.pixels for c in file.channels().values()]
            assert file.header()["compression"] == OpenEXR.ZIP_COMPRESSION
        assert len(pixels) == channels
        assert all(p.dtype == dtype for p in pixels)


def test_opencv_reads_what_is_written_as_the_public_tools_do(scene_root):
    folder = scene_root / "000000"
    code = (
        "import cv2, sys\n"
        "for name in sys.argv[1:]:\n"
        "    image = cv2.imread(name, cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH)\n"
        "    print(image.shape, image.dtype, repr(float(image[5, 7].ravel()[-1])))\n"
    )
    names = ["1001.0001.rgb_olat.exr", "0000.0001.rgb_mix.exr", "0000.0001.depth.exr"]
    result = subprocess.run(
        [sys.executable, "-c", code, *(str(folder / n) for n in names)],
        env={**os.environ, "OPENCV_IO_ENABLE_OPENEXR": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    lines = result.stdout.splitlines()
    assert lines[0].startswith("(32, 64, 3) float32")
    red = next(iter(read_exr(folder / names[0]).values()))[5, 7, 0]
    assert float(lines[0].split()[-1]) == pytest.approx(float(red))
    assert lines[2].startswith("(32, 64) float32")


def test_previews_are_agx(scene_root):
    [scene] = open_scenes(scene_root)
    shown = scene.picture(1001, 1, "rgb_ldr_olat.png")
    exposure = scene.meta(0)["source"]["exposure"]
    expected = agx(scene.exr(1001, 1, "rgb_olat.exr") * np.float32(exposure))
    assert np.abs(shown - expected).max() < 0.6 / 255


def test_views_are_inferred_from_names(scene_root, tmp_path):
    write_scene(tmp_path, "000123", [panorama(height=16)])
    [scene] = open_scenes(tmp_path / "000123")
    assert scene.views == [1]
    assert scene.olat_passes == [1001, 1002, 1003]
    with pytest.raises(InputError, match="no view 2"):
        scene.read_view(2)


def test_shards_of_ten_are_read_without_unpacking(scene_root, tmp_path):
    for scene in ("000008", "000009", "000010"):
        write_scene(tmp_path / "scenes", scene, [panorama(height=16)])
    folders = list((tmp_path / "scenes").iterdir())
    shards = write_shards(folders, tmp_path / "shards", "training")
    assert [s.name for s in shards] == ["training-0000.tar", "training-0001.tar"]
    scenes = open_scenes(tmp_path / "shards")
    assert [s.scene_id for s in scenes] == ["000008", "000009", "000010"]
    packed = scenes[0].read_view(1, mix=2)
    loose = open_scenes(tmp_path / "scenes" / "000008")[0].read_view(1, mix=2)
    assert np.array_equal(packed.lights, loose.lights)
    assert packed.lamps == loose.lamps
    again = write_shards(folders, tmp_path / "again", "training")
    assert [a.read_bytes() for a in again] == [s.read_bytes() for s in shards]


def test_training_reads_from_shards(tmp_path):
    views = [panorama(height=16), panorama((4.0, 3.0, 1.4), height=16)]
    folder = write_scene(tmp_path / "scenes", "000004", views)
    write_shards([folder], tmp_path / "shards", "test")
    packed, loose = public_views(tmp_path / "shards"), public_views(tmp_path / "scenes")
    assert [(v.room, v.view) for v in packed] == [("000004", 1), ("000004", 2)]
    photo = SingleViewSamples(packed, (16, 16), seed=0)[3]
    again = SingleViewSamples(loose, (16, 16), seed=0)[3]
    assert all(np.array_equal(photo[name], again[name]) for name in photo)
    stacked = MultiViewSets(packed, (16, 16), seed=0, views_per_set=4)[0]
    assert stacked["input_linear"].shape == (4, 16, 16, 3)


def test_compact_and_public_convert_both_ways(tmp_path):
    originals = [panorama(height=16), panorama((4.0, 3.0, 1.4), height=16)]
    stems = [tmp_path / "compact" / f"{i:06d}" for i in range(2)]
    for view, stem in zip(originals, stems, strict=True):
        save_rendered(view, stem)
    [scene] = compact_to_public(stems, tmp_path / "public").written
    assert scene.name == "000000"
    back = public_to_compact(tmp_path / "public", tmp_path / "back").written
    assert [b.name for b in back] == ["000000_1", "000000_2"]
    for stem, original in zip(back, originals, strict=True):
        view = load_rendered(stem)
        assert np.allclose(as_taken(view), as_taken(original), rtol=3e-3, atol=1e-5)
        assert np.array_equal(view.on, original.on)
        assert view.room == original.room


def test_what_is_not_known_of_a_scene_does_not_stop_it(tmp_path):
    """Python writes NaN into JSON; where no number is needed it is as good as none."""
    folder = write_scene(tmp_path / "public", "000007", [panorama(height=16)])
    for path in folder.glob("*.json"):
        about = json.loads(path.read_text())
        about["envmap"]["env_strength"] = float("nan")
        path.write_text(json.dumps(about))
    [stem] = public_to_compact(folder, tmp_path / "back").written
    assert load_rendered(stem).metadata["envmap"]["env_strength"] is None


def test_scenes_that_do_not_fit_are_refused(tmp_path):
    camera = look_at(np.array([1.0, 3.0, 1.5]), np.array([5.0, 2.0, 1.2]), 70.0, 16, 12)
    with pytest.raises(InputError, match="panoramas only"):
        write_scene(tmp_path, "000000", [perspective(camera)])
    with pytest.raises(InputError, match="six digits"):
        write_scene(tmp_path, "a;rm -rf ~", [panorama(height=16)])
    with pytest.raises(InputError, match="different rooms"):
        write_scene(tmp_path, "000000", [panorama(height=16), panorama(height=16, room="b")])
    with pytest.raises(InputError, match="no views"):
        write_scene(tmp_path, "000000", [])
    assert list(tmp_path.iterdir()) == []


def test_a_scene_of_ours_is_written_again_and_no_other_is_replaced(tmp_path):
    folder = write_scene(tmp_path, "000007", [panorama(height=16)])
    write_scene(tmp_path, "000007", [panorama(height=16), panorama((4.0, 3.0, 1.4), height=16)])
    assert open_scenes(folder)[0].views == [1, 2]
    (folder / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match=r"notes\.txt, which would be lost"):
        write_scene(tmp_path, "000007", [panorama(height=16)])
    (folder / "notes.txt").unlink()
    # A scene of the public dataset has the same names; what made it is not in its metadata.
    about = json.loads((folder / "0000.meta.json").read_text())
    del about["source"]
    (folder / "0000.meta.json").write_text(json.dumps(about))
    with pytest.raises(InputError, match="000007 was not written by this program"):
        write_scene(tmp_path, "000007", [panorama(height=16)])
    assert open_scenes(folder)[0].views == [1, 2]
    (tmp_path / "000008").mkdir()
    write_scene(tmp_path, "000008", [panorama(height=16)])
    (tmp_path / "000009").write_text("mine")
    with pytest.raises(InputError, match="000009 is a file"):
        write_scene(tmp_path, "000009", [panorama(height=16)])


@pytest.mark.parametrize(
    "damage",
    [
        lambda about: about.pop("lighting"),
        lambda about: about["camera_pose"].clear(),
        lambda about: about["camera_pose"][0].update(rotation=[0, 0, 0, 0]),
        lambda about: about["lighting"][0].update(power="strong"),
        lambda about: about["lighting"][0].update(power=float("inf")),
        lambda about: about["lighting"][0].update(power=10**400),
        lambda about: about["lighting"][0].update(color=[1, float("nan"), 1]),
        lambda about: about["lighting"][0].update(id="another"),
        lambda about: about["lighting"].__setitem__(0, "lamp"),
        lambda about: about["camera_pose"][0].update(position=[float("nan"), 0, 0]),
        lambda about: about["source"].update(exposure="bright"),
        lambda about: about["source"].update(exposure=0),
        lambda about: about.update(source="nobody"),
    ],
)
def test_damaged_metadata_are_one_sentence(tmp_path, damage):
    write_scene(tmp_path, "000007", [panorama(height=16)])
    path = tmp_path / "000007" / "0000.meta.json"
    about = json.loads(path.read_text())
    damage(about)
    path.write_text(json.dumps(about))
    with pytest.raises(FormatError, match="000007 view 1"):
        open_scenes(tmp_path)[0].read_view(1)


def test_a_missing_pass_is_named(tmp_path):
    write_scene(tmp_path, "000007", [panorama(height=16)])
    (tmp_path / "000007" / "1000.0001.rgb_bg.exr").unlink()
    with pytest.raises(InputError, match=r"1000\.0001\.rgb_bg\.exr"):
        open_scenes(tmp_path)[0].read_view(1)


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 12), st.integers(0, 2**32 - 1))
def test_painted_masks_come_back_through_eight_bits(count, seed):
    rng = np.random.default_rng(seed)
    owner = rng.integers(-1, count, (6, 8))
    masks = np.array([owner == i for i in range(count)])
    picture = np.round(paint_masks(masks) * 255) / 255
    for i in range(count):
        assert np.array_equal(pick_mask(picture, i, count), masks[i])


def test_mask_colours_are_those_of_turbo():
    import matplotlib

    turbo = matplotlib.colormaps["turbo"].resampled(5)
    assert np.allclose(mask_colours(5), [turbo(i)[:3] for i in range(5)])


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_quaternions_and_matrices_are_inverse(seed):
    wxyz = np.random.default_rng(seed).normal(size=4)
    rotation = matrix_from_quaternion(wxyz)
    assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.allclose(matrix_from_quaternion(quaternion_from_matrix(rotation)), rotation)


def test_photos_go_out_with_their_cameras(tmp_path):
    import pycolmap

    source = ViewSource(panorama())
    crops = [source.cut(view_rotation(a, 0.0), 60.0, 32, 24) for a in (0.0, 40.0)]
    export_photos(crops, tmp_path / "out")
    about = json.loads((tmp_path / "out" / "transforms.json").read_text())
    camera = camera_from_nerfstudio(about["frames"][1])
    assert np.allclose(camera.c2w, crops[1].camera.c2w)
    with Image.open(tmp_path / "out" / about["frames"][0]["file_path"]) as image:
        assert image.size == (32, 24)
    model = pycolmap.Reconstruction(str(tmp_path / "out" / "sparse" / "0"))
    image = next(i for i in model.images.values() if i.name == "0001.png")
    assert np.allclose(image.cam_from_world().matrix(), crops[1].camera.viewmat[:3])
    assert model.cameras[image.camera_id].focal_length_x == pytest.approx(crops[1].camera.fx)
    with pytest.raises(InputError, match="no photos"):
        export_photos([], tmp_path / "none")
