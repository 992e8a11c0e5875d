"""Exports, read back by pycolmap and by a plain reading of nerfstudio's convention."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from plyfile import PlyData

from luxcore.cameras import Camera
from luxcore.capture import Capture, Points, View, export_capture, ingest, write_capture
from luxcore.settings.capture import CaptureSettings


@pytest.fixture
def capture(tmp_path: Path, box_room, ring_cameras: list[Camera]) -> Capture:
    views = [View(f"{i}.png", box_room.photo(c)[0], c) for i, c in enumerate(ring_cameras[:3])]
    xyz = np.random.Generator(np.random.PCG64(2)).normal(size=(6, 3)).astype(np.float32)
    points = Points(xyz, np.arange(18, dtype=np.uint8).reshape(6, 3))
    return write_capture(
        tmp_path / "room", "room", views, points, source="rendered", metric=True, exposure=1.0
    )


def test_pycolmap_reads_the_same_cameras(tmp_path: Path, capture: Capture) -> None:
    export_capture(capture, tmp_path / "colmap", "colmap")
    model = pycolmap.Reconstruction(tmp_path / "colmap" / "sparse" / "0")
    assert model.num_reg_images() == 3
    for image in model.images.values():
        frame = next(f for f in capture.frames if f.image_path.name == image.name)
        assert np.abs(image.cam_from_world().matrix() - frame.camera.viewmat[:3]).max() < 1e-12
        assert np.abs(image.camera.calibration_matrix() - frame.camera.intrinsics).max() < 1e-12
        # The same point of the world falls on the same pixel.
        point = frame.camera.c2w[:3] @ [0.2, -0.1, 2.0, 1.0]
        local = frame.camera.viewmat[:3] @ [*point, 1]
        pixel = (frame.camera.intrinsics @ local)[:2] / local[2]
        assert image.project_point(point) == pytest.approx(pixel, abs=1e-9)
    places = np.stack([p.xyz for p in model.points3D.values()])
    assert np.abs(np.sort(places, 0) - np.sort(capture.points.xyz, 0)).max() < 1e-7
    assert (tmp_path / "colmap" / "images" / "0002.png").is_file()


def test_nerfstudio_convention(tmp_path: Path, capture: Capture) -> None:
    export_capture(capture, tmp_path / "ns", "nerfstudio")
    transforms = json.loads((tmp_path / "ns" / "transforms.json").read_text())
    frame, camera = transforms["frames"][1], capture.frames[1].camera
    c2w = np.array(frame["transform_matrix"])
    # nerfstudio's camera looks along its -z with y up.
    assert -c2w[:3, 2] == pytest.approx(camera.c2w[:3, 2])
    assert c2w[:3, 1] == pytest.approx(-camera.c2w[:3, 1])
    assert (frame["w"], frame["h"], frame["fl_x"]) == (camera.width, camera.height, camera.fx)
    vertex = PlyData.read(str(tmp_path / "ns" / transforms["ply_file_path"]))["vertex"]
    assert vertex.count == 6


@pytest.mark.parametrize("layout", ["nerfstudio", "colmap"])
def test_what_is_exported_comes_back(tmp_path: Path, capture: Capture, layout) -> None:
    export_capture(capture, tmp_path / "x", layout)
    again = ingest(tmp_path / "x", tmp_path / "again", CaptureSettings(), 0)
    assert again.source == layout
    ours = np.stack([f.camera.centre for f in capture.frames])
    theirs = np.stack([f.camera.centre for f in again.frames])
    # COLMAP's world is turned upright and rescaled, so only shapes can be compared there.
    scale = np.linalg.norm(theirs[0] - theirs[1]) / np.linalg.norm(ours[0] - ours[1])
    assert scale == pytest.approx(1.0) or layout == "colmap"
    gaps = [np.linalg.norm(p[:, None] - p[None], axis=-1) for p in (ours, theirs)]
    assert gaps[1] == pytest.approx(scale * gaps[0], abs=1e-9)
    for a, b in zip(capture.frames, again.frames, strict=True):
        assert a.image_path.read_bytes() == b.image_path.read_bytes()
