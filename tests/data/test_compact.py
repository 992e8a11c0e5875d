"""The compact form on disk: there and back, and what a damaged one says."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from analytic import panorama, perspective

from luxcore.cameras import look_at
from luxcore.data.compact import as_taken, list_rendered, load_rendered, save_rendered
from luxcore.data.training import SingleViewSamples
from luxcore.errors import FormatError, InputError


def test_panorama_comes_back(tmp_path):
    view = panorama(height=32)
    save_rendered(view, tmp_path / "000003")
    again = load_rendered(tmp_path / "000003.json")
    assert again.lamps == view.lamps
    assert np.allclose(again.lights, view.lights, rtol=1e-3, atol=1e-6)
    assert np.array_equal(again.ray_distance_m, view.ray_distance_m)
    assert np.array_equal(again.masks["hull"], view.masks["hull"])
    assert np.allclose(again.c2w, view.c2w)
    assert again.exposure == view.exposure
    assert again.camera is None


def test_perspective_comes_back(tmp_path):
    camera = look_at(np.array([1.0, 3.0, 1.5]), np.array([5.0, 2.0, 1.2]), 70.0, 32, 24)
    save_rendered(perspective(camera), tmp_path / "0000")
    again = load_rendered(tmp_path / "0000")
    assert again.camera is not None
    assert np.allclose(again.camera.c2w, camera.c2w)


def test_photo_is_ambient_plus_lamps_that_burn(tmp_path):
    view = panorama(height=16)
    expected = view.ambient + sum(
        np.float32(lamp.scale) * light
        for lamp, light in zip(view.lamps, view.lights, strict=True)
        if lamp.on
    )
    assert np.allclose(as_taken(view), expected, rtol=1e-6)


def test_views_are_listed_and_sampled_from_disk(tmp_path):
    for number in range(2):
        save_rendered(panorama(height=32), tmp_path / f"{number:06d}")
    (tmp_path / "other.json").write_text("{}")
    stems = list_rendered(tmp_path)
    assert [s.name for s in stems] == ["000000", "000001"]
    assert SingleViewSamples(stems, (16, 24), seed=0)[0]["input_linear"].shape == (16, 24, 3)
    with pytest.raises(InputError, match="no rendered views"):
        list_rendered(tmp_path / "nothing")


def test_a_view_without_lamps(tmp_path):
    save_rendered(panorama(height=16, lamps=0), tmp_path / "v")
    assert load_rendered(tmp_path / "v").lights.shape == (0, 16, 32, 3)


@pytest.mark.parametrize("suffix", [".exr", ".geometry.exr", ".masks.exr", ".json"])
def test_a_missing_file_is_named(tmp_path, suffix):
    save_rendered(panorama(height=16), tmp_path / "v")
    (tmp_path / f"v{suffix}").unlink()
    with pytest.raises(InputError, match=f"v{suffix}"):
        load_rendered(tmp_path / "v")


def test_files_that_do_not_fit_are_refused(tmp_path):
    save_rendered(panorama(height=16), tmp_path / "v")
    save_rendered(panorama(height=8), tmp_path / "w")
    (tmp_path / "v.geometry.exr").write_bytes((tmp_path / "w.geometry.exr").read_bytes())
    with pytest.raises(FormatError, match="differ in size"):
        load_rendered(tmp_path / "v")
    about = json.loads((tmp_path / "w.json").read_text())
    about["lamps"].append(about["lamps"][0])
    (tmp_path / "w.json").write_text(json.dumps(about))
    with pytest.raises(FormatError, match="light_03"):
        load_rendered(tmp_path / "w")
    for text in ("[" * 100_000, '{"version": ' + "1" * 5000 + "}"):
        (tmp_path / "w.json").write_text(text)
        with pytest.raises(FormatError, match="not JSON"):
            load_rendered(tmp_path / "w")


@pytest.mark.parametrize(
    ("damage", "fact"),
    [
        (lambda about: about.update(exposure=float("nan")), "exposure is null"),
        (lambda about: about["lamps"][0].update(on="no"), "neither true nor false"),
        (lambda about: about.update(exposure=0), "exposure is 0"),
        (lambda about: about["lamps"][0].update(scale=[1, 1, float("inf")]), "scale of lamp"),
        (lambda about: about["lamps"][0].update(scale=[1, 1, 10**400]), "scale of lamp"),
        (lambda about: about["lamps"][0].update(scale=2), "scale of lamp"),
        (lambda about: about["lamps"][1].update(power_w="strong"), "power of lamp"),
        (lambda about: about["lamps"].pop(), "light_02 belongs to no lamp, there are 2"),
        (lambda about: about["lamps"].clear(), "light_00 belongs to no lamp, there are 0"),
        (lambda about: about.update(lamps=["one"]), "do not agree"),
        (lambda about: about["camera"].update(transform_matrix=[[1]]), "finite 4x4 matrix"),
        (
            lambda about: about["camera"].update(transform_matrix=np.diag([1, 1, -1, 1]).tolist()),
            "mirrors",
        ),
        (lambda about: about.update(camera=[]), "do not agree"),
    ],
)
def test_numbers_that_are_none_name_the_file_and_the_fact(tmp_path, damage, fact):
    save_rendered(panorama(height=16), tmp_path / "v")
    about = json.loads((tmp_path / "v.json").read_text())
    damage(about)
    (tmp_path / "v.json").write_text(json.dumps(about))
    with pytest.raises(FormatError, match=rf"v\.json.*{fact}"):
        load_rendered(tmp_path / "v")


def test_the_camera_of_a_perspective_view_is_named_with_its_file(tmp_path):
    camera = look_at(np.array([1.0, 3.0, 1.5]), np.array([5.0, 2.0, 1.2]), 70.0, 32, 24)
    save_rendered(perspective(camera), tmp_path / "v")
    about = json.loads((tmp_path / "v.json").read_text())
    about["camera"]["fl_x"] = 0
    (tmp_path / "v.json").write_text(json.dumps(about))
    with pytest.raises(FormatError, match=r"v\.json.*positive focal length"):
        load_rendered(tmp_path / "v")
