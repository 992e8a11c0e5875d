"""Captures on disk: what is written comes back, and what a stranger changed is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from luxcore.cameras import camera_from_nerfstudio, camera_to_nerfstudio, look_at
from luxcore.capture import Capture, Points, Skipped, View, load_capture, write_capture
from luxcore.errors import FormatError, InputError


def _capture(folder: Path, views: int = 3) -> Capture:
    rng = np.random.Generator(np.random.PCG64(0))
    shots = [
        View(
            f"IMG_{i}.jpg",
            rng.random((20, 30, 3), dtype=np.float32),
            look_at(np.array([0.3 * i, 0, 1.5]), np.array([3.0, 0, 1]), 60.0, 30, 20),
        )
        for i in range(views)
    ]
    points = Points(rng.normal(size=(7, 3)).astype(np.float32), np.full((7, 3), 9, np.uint8))
    return write_capture(
        folder,
        "room-1",
        shots,
        points,
        source="photos",
        metric=True,
        exposure=0.25,
        skipped=[Skipped("blurred.jpg", "could not be placed")],
    )


def test_round_trip(tmp_path: Path) -> None:
    written = _capture(tmp_path / "c")
    read = load_capture(tmp_path / "c")
    assert (read.id, read.metric, read.exposure, read.truth) == ("room-1", True, 0.25, None)
    assert [f.name for f in read.frames] == ["IMG_0.jpg", "IMG_1.jpg", "IMG_2.jpg"]
    assert read.skipped == (Skipped("blurred.jpg", "could not be placed"),)
    assert np.array_equal(read.points.xyz, written.points.xyz)
    eye = read.frames[2].camera.centre
    assert eye == pytest.approx([0.6, 0, 1.5], abs=1e-12)


def test_equal_captures_have_equal_bytes(tmp_path: Path) -> None:
    _capture(tmp_path / "a")
    _capture(tmp_path / "b")
    for file in sorted((tmp_path / "a").rglob("*.*")):
        assert file.read_bytes() == (tmp_path / "b" / file.relative_to(tmp_path / "a")).read_bytes()


@pytest.mark.parametrize(
    "name", ["../../etc/passwd", "/etc/passwd", "images\\0000.png", "images/\0.png", "a" * 10_000]
)
def test_pictures_outside_the_capture_are_refused(tmp_path: Path, name: str) -> None:
    _capture(tmp_path / "c")
    path = tmp_path / "c" / "transforms.json"
    transforms = json.loads(path.read_text())
    transforms["frames"][1]["file_path"] = name
    path.write_text(json.dumps(transforms))
    with pytest.raises(FormatError, match=r"transforms\.json names a file"):
        load_capture(tmp_path / "c")


@pytest.mark.parametrize(
    ("change", "fact"),
    [
        (lambda t: t["frames"][0].update(fl_x=0), "positive focal length"),
        (lambda t: t["frames"][0]["transform_matrix"][0].__setitem__(0, 9.0), "orthonormal"),
        (lambda t: t.update(frames=[]), "no frames"),
        (lambda t: t.update(frames={"a": 1}), "list of frames"),
        (lambda t: t["frames"][0].pop("file_path"), "file_path"),
    ],
)
def test_damaged_transforms_are_named(tmp_path: Path, change, fact: str) -> None:
    _capture(tmp_path / "c")
    path = tmp_path / "c" / "transforms.json"
    transforms = json.loads(path.read_text())
    change(transforms)
    path.write_text(json.dumps(transforms))
    with pytest.raises(FormatError, match=fact):
        load_capture(tmp_path / "c")


@pytest.mark.parametrize(
    ("change", "fact"),
    [
        ({"exposure": float("nan")}, "exposure is NaN"),
        ({"exposure": 10**400}, "exposure is 1000"),
        ({"exposure": 0}, "exposure is 0"),
        ({"id": "../x"}, "1 to 64 characters"),
        ({"skipped": [1]}, "usable"),
    ],
)
def test_a_damaged_description_is_named(tmp_path: Path, change: dict, fact: str) -> None:
    _capture(tmp_path / "c")
    path = tmp_path / "c" / "capture.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(InputError, match=fact):
        load_capture(tmp_path / "c")


@pytest.mark.parametrize("capture_id", ["", "Room", "a b", "../x", "a;rm -rf ~", "x" * 65])
def test_ids_that_are_no_folder_names_are_refused(tmp_path: Path, capture_id: str) -> None:
    points = Points(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint8))
    with pytest.raises(InputError, match="1 to 64 characters"):
        write_capture(tmp_path / "c", capture_id, [], points, source="photos", metric=False)


def test_a_failure_half_way_leaves_the_earlier_capture(tmp_path: Path) -> None:
    _capture(tmp_path / "c")

    def views():
        yield View(
            "a.png",
            np.zeros((4, 6, 3), np.float32),
            look_at(np.zeros(3), np.array([1.0, 0, 0]), 60.0, 6, 4),
        )
        raise InputError("b.png is not a readable picture.")

    points = Points(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint8))
    with pytest.raises(InputError):
        write_capture(tmp_path / "c", "room-1", views(), points, source="photos", metric=False)
    assert len(load_capture(tmp_path / "c").frames) == 3
    assert [f.name for f in tmp_path.iterdir()] == ["c"]


@pytest.mark.parametrize(
    ("change", "fact"),
    [
        ({"w": float("inf")}, "not a number"),
        ({"fl_x": 10**400}, "not a number"),
        ({"fl_x": 1e30}, "positive focal length"),
        (
            {"transform_matrix": (np.eye(4) * [1, 1, 1, 1] + np.eye(4)[:, ::-1] * 1e30).tolist()},
            "4x4",
        ),
    ],
)
def test_a_camera_beyond_float32_is_refused(change: dict, fact: str) -> None:
    frame = {"fl_x": 50, "w": 64, "h": 48, "transform_matrix": np.eye(4).tolist()}
    with pytest.raises(InputError, match=fact):
        camera_from_nerfstudio(frame | change)


@pytest.mark.parametrize(
    ("matrix", "fact"),
    [
        (np.diag([-1.0, 1, 1, 1]), "mirrors"),
        (np.eye(4)[[1, 0, 2, 3]], "mirrors"),
        (np.eye(4) + np.eye(4)[[3, 1, 2, 0]], "0 0 0 1"),
        (np.diag([1.0, 1, 1, 2]), "0 0 0 1"),
        (np.diag([1.0, 1, 1, 0]), "0 0 0 1"),
        (np.diag([2.0, 2, 2, 1]), "orthonormal"),
        (np.eye(4) + 0.1 * np.eye(4, k=1) * [[1], [1], [0], [0]], "orthonormal"),
    ],
)
def test_a_matrix_that_is_no_pose_is_refused(matrix: np.ndarray, fact: str) -> None:
    frame = {"fl_x": 50, "w": 64, "h": 48, "transform_matrix": matrix.tolist()}
    with pytest.raises(InputError, match=fact):
        camera_from_nerfstudio(frame)


@pytest.mark.parametrize("rows", [3, 4])
def test_a_pose_rounded_to_four_digits_is_taken(rows: int) -> None:
    """As the tools of others write it, with or without the last row."""
    camera = look_at(np.array([1.0, 2.0, 3.0]), np.array([-0.3, 0.2, 1.0]), 60.0, 64, 48)
    frame = camera_to_nerfstudio(camera)
    frame["transform_matrix"] = np.round(frame["transform_matrix"], 4)[:rows].tolist()
    assert camera_from_nerfstudio(frame).c2w == pytest.approx(camera.c2w, abs=1e-4)
