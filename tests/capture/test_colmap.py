"""COLMAP models: equal to pycolmap's reading, and refused where pycolmap takes anything."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pycolmap
import pytest

from luxcore.capture.colmap_files import find_model, read_model
from luxcore.errors import FormatError


def _model(folder: Path, binary: bool = True) -> Path:
    """Three images with distortion, written by pycolmap."""
    model = pycolmap.Reconstruction()
    camera = pycolmap.Camera(
        model="OPENCV", width=640, height=480, params=[500, 510, 322, 238, 0.1, -0.02, 1e-3, 2e-3]
    )
    camera.camera_id = 1
    model.add_camera_with_trivial_rig(camera)
    for index in range(3):
        image = pycolmap.Image(name=f"room/{index}.jpg", camera_id=1, image_id=index + 1)
        quaternion = np.array([0.1 * index, 0.2, 0.05, 0.9])
        rotation = pycolmap.Rotation3d(quaternion / np.linalg.norm(quaternion))
        pose = pycolmap.Rigid3d(rotation, np.array([0.5 * index, -0.2, 1.0]))
        model.add_image_with_trivial_frame(image, pose)
    model.add_point3D(np.array([1.0, 2, 3]), pycolmap.Track(), np.array([9, 8, 7], np.uint8))
    folder.mkdir(parents=True)
    (model.write_binary if binary else model.write_text)(folder)
    return folder


@pytest.mark.parametrize("binary", [True, False])
def test_same_as_pycolmap(tmp_path: Path, binary: bool) -> None:
    folder = _model(tmp_path / "sparse" / "0", binary)
    assert find_model(tmp_path) == folder
    ours = read_model(folder, tmp_path)
    theirs = {i.name: i for i in pycolmap.Reconstruction(folder).images.values()}
    assert [i.name for i in ours.images] == ["room/0.jpg", "room/1.jpg", "room/2.jpg"]
    for image in ours.images:
        pose = theirs[image.name].cam_from_world().matrix()
        assert np.abs(image.w2c[:3] - pose).max() < 1e-12
    lens = ours.images[0].lens
    assert (lens.fx, lens.fy, lens.cx, lens.cy) == (500, 510, 322, 238)
    assert lens.distortion == (0.1, -0.02, 1e-3, 2e-3)
    assert ours.points.xyz.tolist() == [[1, 2, 3]]
    assert ours.points.rgb.tolist() == [[9, 8, 7]]


def test_a_model_from_elsewhere(shared_data: Path) -> None:
    folder = shared_data / "colmap-model" / "sparse" / "0"
    ours = read_model(folder, folder)
    theirs = pycolmap.Reconstruction(folder)
    poses = {i.name: i.cam_from_world().matrix() for i in theirs.images.values()}
    assert len(ours.images) == len(poses)
    assert all(np.abs(i.w2c[:3] - poses[i.name]).max() < 1e-12 for i in ours.images)
    assert len(ours.points.xyz) == theirs.num_points3D()


@pytest.mark.parametrize(
    ("name", "fact"),
    [
        ("../../../etc/passwd", "outside its folder"),
        ("/etc/passwd", "outside its folder"),
        ("a\\b.png", "outside its folder or malformed"),
        ("x" * 900, "malformed"),
        ("room/1.jpg", "twice"),
    ],
)
def test_hostile_names(tmp_path: Path, name: str, fact: str) -> None:
    folder = _model(tmp_path / "m", binary=False)
    path = folder / "images.txt"
    path.write_text(path.read_text().replace("room/2.jpg", name))
    with pytest.raises(FormatError, match=fact):
        read_model(folder, tmp_path)


def _rewrite(path: Path, row: int, column: int, value: str) -> None:
    """Change one word of the given data row of a text file."""
    lines = path.read_text().splitlines()
    data = [i for i, line in enumerate(lines) if not line.startswith("#")]
    words = lines[data[row]].split()
    words[column] = value
    lines[data[row]] = " ".join(words)
    path.write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize(
    ("file", "row", "column", "value", "fact"),
    [
        ("cameras.txt", 0, 4, "nan", "unusable"),
        ("cameras.txt", 0, 4, "0", "unusable"),
        ("cameras.txt", 0, 2, "-5", "pixels"),
        ("cameras.txt", 0, 1, "FISHEYE", "model FISHEYE"),
        ("images.txt", 2, 5, "inf", r"room/1\.jpg"),
        ("images.txt", 2, 8, "77", "camera 77"),
        ("images.txt", 2, 1, "abc", "not a readable"),
    ],
)
def test_bad_numbers_are_named(
    tmp_path: Path, file: str, row: int, column: int, value: str, fact: str
) -> None:
    folder = _model(tmp_path / "m", binary=False)
    _rewrite(folder / file, row, column, value)
    with pytest.raises(FormatError, match=fact):
        read_model(folder, tmp_path)


def test_zero_quaternion_names_the_image(tmp_path: Path) -> None:
    folder = _model(tmp_path / "m", binary=False)
    for column in range(1, 5):
        _rewrite(folder / "images.txt", 2, column, "0")
    with pytest.raises(FormatError, match=r"room/1\.jpg"):
        read_model(folder, tmp_path)


@pytest.mark.parametrize("file", ["cameras.bin", "images.bin", "points3D.bin"])
def test_counts_beyond_the_file(tmp_path: Path, file: str) -> None:
    folder = _model(tmp_path / "m")
    raw = (folder / file).read_bytes()
    (folder / file).write_bytes(struct.pack("<Q", 2**40) + raw[8:])
    with pytest.raises(FormatError, match="1099511627776"):
        read_model(folder, tmp_path)


@pytest.mark.parametrize("file", ["cameras.bin", "images.bin", "points3D.bin"])
def test_files_cut_short(tmp_path: Path, file: str) -> None:
    folder = _model(tmp_path / "m")
    raw = (folder / file).read_bytes()
    (folder / file).write_bytes(raw[: len(raw) - 5])
    with pytest.raises(FormatError):
        read_model(folder, tmp_path)


def test_all_cameras_in_one_place(tmp_path: Path) -> None:
    folder = _model(tmp_path / "m", binary=False)
    for row in (0, 2, 4):
        for column, value in zip(range(1, 8), "1000000", strict=True):
            _rewrite(folder / "images.txt", row, column, value)
    with pytest.raises(FormatError, match="in one place"):
        read_model(folder, tmp_path)
