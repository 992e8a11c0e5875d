"""A rendered room as a capture: one exposure, photos that follow from the lights, exact points."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from luxcore.cameras import Camera, camera_to_nerfstudio
from luxcore.capture import from_rendered
from luxcore.capture.rendered import input_linear
from luxcore.errors import FormatError, InputError
from luxcore.files.atomic import write_json
from luxcore.files.exr import read_exr, write_exr
from luxcore.files.photos import read_photo
from luxcore.light.agx import agx
from luxcore.settings.capture import CaptureSettings

LAMPS = [
    {"id": 0, "name": "desk", "on": True, "scale": [4.0, 3.0, 2.0]},
    {"id": 1, "name": "hall", "on": False, "scale": [9.0, 9.0, 9.0]},
]


@pytest.fixture
def rendered(tmp_path: Path, box_room, ring_cameras: list[Camera]) -> Path:
    """Four views whose exposures differ, as the renderer sets them one by one."""
    folder = tmp_path / "demo" / "views"
    for index, camera in enumerate(ring_cameras[:4]):
        photo, distance = box_room.photo(camera)
        stem = folder / f"{index:04d}"
        lights = {"ambient": 0.1 * photo, "light_00": 0.05 * photo, "light_01": 0.2 * photo}
        write_exr(stem.with_suffix(".exr"), {**lights, "albedo": photo}, half=False)
        geometry = {"ray_distance_m": distance.astype(np.float32)}
        write_exr(folder / f"{index:04d}.geometry.exr", geometry, half=False)
        write_exr(folder / f"{index:04d}.masks.exr", {"fixture_00": photo[..., 0] > 0.9})
        about = {
            "version": 1,
            "kind": "perspective",
            "camera": camera_to_nerfstudio(camera),
            "room": "box",
            "lamps": LAMPS,
            "exposure": 1.0 + index,
        }
        write_json(stem.with_suffix(".json"), about)
    return tmp_path / "demo"


def test_photos_follow_from_the_lights(tmp_path: Path, rendered: Path, box_room) -> None:
    capture = from_rendered(rendered, tmp_path / "demo-room", CaptureSettings())
    assert (capture.id, capture.source, capture.metric) == ("demo-room", "rendered", True)
    assert capture.exposure == 2.5
    albedo = box_room.photo(capture.frames[2].camera)[0]
    expected = agx((0.1 + 0.05 * np.float32([4, 3, 2])) * albedo * np.float32(2.5))
    photo = read_photo(capture.frames[2].image_path)
    # Half a step of 8 bits.
    assert np.abs(photo - expected).max() <= 0.5 / 255 + 1e-4


def test_truth_is_kept_whole(tmp_path: Path, rendered: Path) -> None:
    capture = from_rendered(rendered, tmp_path / "c", CaptureSettings(), capture_id="named")
    assert capture.id == "named"
    assert capture.truth is not None
    layers = read_exr(capture.truth / "0003.exr")
    assert {"ambient", "light_00", "light_01"} <= set(layers)
    lights = json.loads((capture.truth / "lights.json").read_text())
    assert [lamp["on"] for lamp in lights["lamps"]] == [True, False]
    assert lights["exposure"] == 2.5
    both = {**lights, "lamps": [{**lamp, "on": True} for lamp in lights["lamps"]]}
    gain = input_linear(tmp_path, both, layers) - input_linear(tmp_path, lights, layers)
    assert np.allclose(gain, 9 * layers["light_01"], rtol=1e-5, atol=1e-6)


def test_points_lie_on_the_walls(tmp_path: Path, rendered: Path) -> None:
    capture = from_rendered(rendered, tmp_path / "c", CaptureSettings(points=2000))
    assert 1500 < len(capture.points.xyz) <= 2100
    off_wall = np.abs(np.abs(capture.points.xyz - [0, 0, 1.4]) / [2.5, 2.0, 1.4] - 1).min(axis=1)
    assert off_wall.max() < 1e-5


@pytest.mark.parametrize(
    ("change", "fact"),
    [
        (lambda a: a.pop("exposure"), "positive exposure"),
        (lambda a: a.update(exposure=0), "positive exposure"),
        (lambda a: a.pop("camera"), "lacks a camera"),
        (lambda a: a["lamps"].append({"on": True, "scale": [1, 1, 1]}), "light_02"),
    ],
)
def test_incomplete_views_are_named(tmp_path: Path, rendered: Path, change, fact: str) -> None:
    path = rendered / "views" / "0001.json"
    about = json.loads(path.read_text())
    change(about)
    path.write_text(json.dumps(about))
    with pytest.raises(FormatError, match=r"0001\.json.*" + fact):
        from_rendered(rendered, tmp_path / "c", CaptureSettings())
    assert not (tmp_path / "c").exists()


def test_missing_files(tmp_path: Path, rendered: Path) -> None:
    with pytest.raises(InputError, match="holds no rendered views"):
        from_rendered(tmp_path, tmp_path / "c", CaptureSettings())
    (rendered / "views" / "0002.masks.exr").unlink()
    with pytest.raises(InputError, match=r"0002\.masks\.exr does not exist"):
        from_rendered(rendered, tmp_path / "c", CaptureSettings())
