"""Photos, with poses or without, become captures; what cannot be used ends in one sentence."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from luxcore.cameras import Camera, camera_to_nerfstudio
from luxcore.capture import (
    Points,
    View,
    ingest,
    load_capture,
    placed_sentence,
    pose_error,
    write_capture,
)
from luxcore.capture.photo_folder import find_photos, stage_photos
from luxcore.errors import FormatError, InputError, LuxError
from luxcore.files.digests import tree_digest
from luxcore.files.photos import read_photo, write_png
from luxcore.settings.capture import CaptureSettings

SETTINGS = CaptureSettings(features=1200)
NO_POINTS = Points(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint8))


@pytest.fixture(scope="module")
def photos(tmp_path_factory, box_room, ring_cameras: list[Camera]) -> Path:
    """Eight rendered photos of the box room."""
    folder = tmp_path_factory.mktemp("photos")
    for index, camera in enumerate(ring_cameras):
        write_png(folder / f"{index:04d}.png", box_room.photo(camera)[0])
    return folder


@pytest.fixture(scope="module")
def placed(tmp_path_factory, photos: Path):
    """The photos placed by SfM, beside one that is not a picture."""
    folder = tmp_path_factory.mktemp("mixed")
    shutil.copytree(photos, folder / "in")
    (folder / "in" / "broken.jpg").write_bytes(b"\xff\xd8 not a picture")
    return ingest(folder / "in", folder / "placed", SETTINGS, 0)


def test_sfm_finds_the_true_poses(tmp_path: Path, placed, box_room, ring_cameras) -> None:
    views = [View(f"{i:04d}.png", box_room.photo(c)[0], c) for i, c in enumerate(ring_cameras)]
    truth = write_capture(
        tmp_path / "t", "t", views, NO_POINTS, source="rendered", metric=True, exposure=1.0
    )
    error = pose_error(placed, truth)
    assert error.views == 8
    # A tenth of a pixel is 5 mm at the far wall; the arc of cameras is nearly a line, about which
    # positions alone fix the rotation to a few tenths of a degree.
    assert error.position_max < 0.005
    assert error.rotation_max_deg < 1.0
    focal = placed.frames[0].camera.fx
    assert focal == pytest.approx(ring_cameras[0].fx, rel=0.03)


def test_the_sentence_names_what_was_skipped(placed) -> None:
    sentence = placed_sentence(placed)
    assert sentence.startswith("8 of 9 views placed (broken.jpg: is not a readable picture")


def test_the_room_is_upright_and_of_room_size(placed) -> None:
    centres = np.stack([f.camera.centre for f in placed.frames])
    assert centres[:, 2].mean() == pytest.approx(1.5)
    assert not placed.metric
    ups = np.stack([-f.camera.c2w[:3, 1] for f in placed.frames])
    assert (ups[:, 2] > 0.95).all()
    assert len(placed.points.xyz) > 100


def test_same_photos_and_seed_give_the_same_bytes(tmp_path: Path, photos: Path) -> None:
    subset = tmp_path / "in"
    subset.mkdir()
    for index in range(4):
        shutil.copy(photos / f"{index:04d}.png", subset)
    for name in ("a", "b"):
        ingest(subset, tmp_path / name, SETTINGS, 7, capture_id="same")
    digests = [tree_digest([tmp_path / n], tmp_path / n) for n in ("a", "b")]
    assert digests[0] == digests[1]


def test_photos_that_hardly_overlap_end_in_one_sentence(shared_data: Path, tmp_path: Path) -> None:
    settings = CaptureSettings(image_side=400, features=1000)
    with pytest.raises(LuxError) as caught:
        ingest(shared_data / "room8", tmp_path / "out", settings, 0)
    message = str(caught.value)
    assert caught.value.exit_code == 1
    assert " of 8 views could be placed" in message
    assert "take more photos" in message
    assert "\n" not in message
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_the_indoor_garden_is_placed(shared_data: Path, tmp_path: Path) -> None:
    capture = ingest(shared_data / "fern20", tmp_path / "fern", CaptureSettings(), 0)
    assert placed_sentence(capture) == "20 of 20 views placed"


@pytest.mark.parametrize(
    ("make", "fact"),
    [
        (lambda f: None, "holds no photos"),
        (lambda f: write_png(f / "a.png", np.zeros((60, 80, 3))), "holds 1 readable photo;"),
        (lambda f: [(f / n).write_bytes(b"x") for n in ("a.jpg", "b.jpg")], "2 unusable"),
        (
            lambda f: [
                write_png(f / f"{i}.png", np.zeros((60 if i else 5, 80, 3))) for i in range(3)
            ],
            r"0\.png: 80x5 is smaller than",
        ),
    ],
)
def test_folders_without_enough_photos(tmp_path: Path, make, fact: str) -> None:
    source = tmp_path / "in"
    source.mkdir()
    make(source)
    with pytest.raises(InputError, match=fact):
        ingest(source, tmp_path / "out", SETTINGS, 0)
    assert not (tmp_path / "out").exists()


def test_a_source_that_is_no_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not a folder"):
        ingest(tmp_path / "absent", tmp_path / "out", SETTINGS, 0)


def test_photos_in_two_folders_must_be_named(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        write_png(tmp_path / name / "0.png", np.zeros((60, 80, 3)))
    with pytest.raises(InputError, match=r"2 folders \(a, b\)"):
        find_photos(tmp_path)


def test_photos_deep_in_a_folder_are_found(shared_data: Path) -> None:
    assert len(find_photos(shared_data / "fern20")) == 20


def test_large_photos_are_reduced_upright_with_their_focal_length(tmp_path: Path) -> None:
    image = Image.fromarray(np.full((400, 300, 3), 128, np.uint8))
    exif = image.getexif()
    exif[0x0112] = 6  # to be turned a quarter before it is shown
    exif.get_ifd(0x8769)[0xA405] = 28
    image.save(tmp_path / "a.jpg", exif=exif)
    (tmp_path / "w").mkdir()
    staged, skipped = stage_photos([tmp_path / "a.jpg"], tmp_path / "w", 200)
    assert not skipped
    assert (staged[0].width, staged[0].height) == (200, 150)
    assert staged[0].focal_px == pytest.approx(200 * 28 / 36)


@pytest.mark.filterwarnings("error")
def test_damaged_exif_costs_the_focal_length_alone(tmp_path: Path) -> None:
    cut_short = b"Exif\0\0II*\0\x08\0\0\0\x40\0" + bytes(7)
    image = Image.fromarray(np.full((60, 80, 3), 128, np.uint8))
    image.save(tmp_path / "a.jpg", exif=cut_short)
    (tmp_path / "w").mkdir()
    staged, skipped = stage_photos([tmp_path / "a.jpg"], tmp_path / "w", 200)
    assert not skipped
    assert staged[0].focal_px is None


def _nerfstudio(folder: Path, box_room, cameras: list[Camera], **shared: object) -> Path:
    (folder / "images").mkdir(parents=True)
    frames = []
    for index, camera in enumerate(cameras):
        write_png(folder / "images" / f"f{index}.png", box_room.photo(camera)[0])
        frames.append({"file_path": f"./images/f{index}", **camera_to_nerfstudio(camera)})
    transforms = {**shared, "frames": frames}
    (folder / "transforms.json").write_text(json.dumps(transforms))
    return folder


def test_nerfstudio_poses_are_kept(tmp_path: Path, box_room, ring_cameras) -> None:
    source = _nerfstudio(tmp_path / "in", box_room, ring_cameras[:2])
    capture = ingest(source, tmp_path / "out", SETTINGS, 0)
    for frame, camera in zip(capture.frames, ring_cameras, strict=False):
        assert np.allclose(frame.camera.c2w, camera.c2w, atol=1e-12)
        assert frame.camera.fx == camera.fx


def test_poses_without_points_get_points(tmp_path: Path, box_room, ring_cameras) -> None:
    source = _nerfstudio(tmp_path / "in", box_room, ring_cameras[:5])
    points = ingest(source, tmp_path / "out", SETTINGS, 0).points.xyz
    assert len(points) > 100
    off_wall = np.abs(np.abs(points - [0, 0, 1.4]) / [2.5, 2.0, 1.4] - 1).min(axis=1)
    assert np.median(off_wall) < 0.01


def test_nerfstudio_distortion_is_removed(tmp_path: Path, box_room, ring_cameras) -> None:
    source = _nerfstudio(tmp_path / "in", box_room, ring_cameras[:2], k1=-0.1, k2=0.01)
    capture = ingest(source, tmp_path / "out", SETTINGS, 0)
    flat = read_photo(capture.frames[0].image_path)
    assert flat.shape == (180, 240, 3)
    assert np.abs(flat - read_photo(source / "images" / "f0.png")).mean() > 0.02
    assert capture.frames[0].camera.fx != ring_cameras[0].fx


@pytest.mark.parametrize(
    ("change", "fact"),
    [
        (lambda t: t.update(camera_model="OPENCV_FISHEYE"), "OPENCV_FISHEYE"),
        (lambda t: t.update(camera_model=["OPENCV"]), "has camera_model"),
        (lambda t: t.update(k1="much"), 'k1 is "much"'),
        (lambda t: t.update(k1=10**400), "k1 is 1000"),
        (lambda t: t.update(p2=float("nan")), "p2 is NaN"),
        (lambda t: t["frames"].pop(), "at least two"),
        (lambda t: t["frames"][0].update(file_path="images/none.png"), "does not exist"),
        (lambda t: t["frames"][0].update(w=100), "its camera says 100x180"),
        (
            lambda t: t["frames"][1].update(transform_matrix=t["frames"][0]["transform_matrix"]),
            "in one place",
        ),
    ],
)
def test_bad_nerfstudio_folders(tmp_path: Path, box_room, ring_cameras, change, fact) -> None:
    source = _nerfstudio(tmp_path / "in", box_room, ring_cameras[:2])
    transforms = json.loads((source / "transforms.json").read_text())
    change(transforms)
    (source / "transforms.json").write_text(json.dumps(transforms))
    with pytest.raises(InputError, match=fact):
        ingest(source, tmp_path / "out", SETTINGS, 0)
    assert not (tmp_path / "out").exists()


def test_drawn_masks_follow_their_photos(tmp_path: Path, box_room, ring_cameras) -> None:
    source = _nerfstudio(tmp_path / "in", box_room, ring_cameras[:3], k1=-0.1)
    rows, columns = np.indices((360, 480))
    disc = np.hypot(rows - 180, columns - 300) < 60
    write_png(source / "masks" / "0002_00.png", disc)
    capture = ingest(source, tmp_path / "out", CaptureSettings(image_side=120), 0)
    assert capture.drawn_masks is not None
    assert [f.name for f in capture.drawn_masks.iterdir()] == ["0002_00.png"]
    stored = read_photo(capture.drawn_masks / "0002_00.png")[..., 0] > 0.5
    assert stored.shape == (90, 120)
    # A quarter of the size, and barrel distortion removed pushes it outward and enlarges it.
    rows, columns = np.nonzero(stored)
    assert rows.mean() == pytest.approx(45, abs=2)
    assert 74 < columns.mean() < 80
    assert 0.9 < stored.sum() / (np.pi * 15**2) < 1.4
    write_png(source / "masks" / "0001_00.png", np.ones((50, 50)))
    with pytest.raises(InputError, match=r"0001_00\.png is 50x50"):
        ingest(source, tmp_path / "out2", SETTINGS, 0)
    (source / "masks" / "0001_00.png").rename(source / "masks" / "0007_00.png")
    with pytest.raises(InputError, match="for view 7, the capture has 3 views"):
        ingest(source, tmp_path / "out2", SETTINGS, 0)


def test_a_capture_is_copied_with_its_truth(tmp_path: Path, box_room, ring_cameras) -> None:
    views = [View(f"{i}.png", box_room.photo(c)[0], c) for i, c in enumerate(ring_cameras[:2])]
    write_capture(
        tmp_path / "a",
        "kept",
        views,
        NO_POINTS,
        source="rendered",
        metric=True,
        exposure=1.0,
        write_truth=lambda folder: (folder / "lights.json").write_text("{}"),
    )
    copied = ingest(tmp_path / "a", tmp_path / "b", SETTINGS, 0)
    assert copied.id == "kept"
    assert copied.truth is not None
    (tmp_path / "a" / "images" / "0001.png").unlink()
    with pytest.raises(FormatError, match=r"0001\.png"):
        ingest(tmp_path / "a", tmp_path / "c", SETTINGS, 0)
    assert load_capture(tmp_path / "b").id == "kept"
