"""A capture as other tools expect it: a nerfstudio folder, or a COLMAP project."""

from __future__ import annotations

import shutil
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from luxcore.cameras import Camera, camera_to_nerfstudio
from luxcore.capture.points import write_points
from luxcore.capture.store import Capture
from luxcore.files.atomic import atomic_folder, write_json

Layout = Literal["nerfstudio", "colmap", "colmap-text"]

_PINHOLE = 1
"""COLMAP's number of the camera model fx, fy, cx, cy."""


def export_capture(capture: Capture, out: Path, layout: Layout) -> None:
    """Write photos and cameras into the folder `out`, whole or not at all.

    nerfstudio: transforms.json, images/, points.ply. COLMAP: sparse/0/*.bin or *.txt, images/; its
    world stays the capture's (z up), and its points have no tracks.
    """
    with atomic_folder(Path(out)) as temporary:
        (temporary / "images").mkdir()
        for frame in capture.frames:
            shutil.copyfile(frame.image_path, temporary / "images" / frame.image_path.name)
        if layout == "nerfstudio":
            _write_nerfstudio(capture, temporary)
        else:
            _write_colmap(capture, temporary / "sparse" / "0")
            if layout == "colmap-text":
                _to_text(temporary / "sparse" / "0")


def _write_nerfstudio(capture: Capture, folder: Path) -> None:
    frames = [
        {"file_path": f"images/{f.image_path.name}", **camera_to_nerfstudio(f.camera)}
        for f in capture.frames
    ]
    transforms = {"camera_model": "OPENCV", "ply_file_path": "points.ply", "frames": frames}
    write_json(folder / "transforms.json", transforms)
    write_points(folder / "points.ply", capture.points)


def _write_colmap(capture: Capture, folder: Path) -> None:
    folder.mkdir(parents=True)
    cameras = [frame.camera for frame in capture.frames]
    names = [frame.image_path.name for frame in capture.frames]
    (folder / "cameras.bin").write_bytes(b"".join(_cameras(cameras)))
    (folder / "images.bin").write_bytes(b"".join(_images(cameras, names)))
    (folder / "points3D.bin").write_bytes(b"".join(_points(capture)))


def _to_text(folder: Path) -> None:
    """COLMAP's own conversion. Readers prefer binary files, so those go."""
    import pycolmap

    pycolmap.Reconstruction(folder).write_text(folder)
    for file in folder.glob("*.bin"):
        file.unlink()


def _cameras(cameras: list[Camera]) -> Iterator[bytes]:
    yield struct.pack("<Q", len(cameras))
    for index, c in enumerate(cameras):
        yield struct.pack("<iiQQ", index + 1, _PINHOLE, c.width, c.height)
        yield struct.pack("<4d", c.fx, c.fy, c.cx, c.cy)


def _images(cameras: list[Camera], names: list[str]) -> Iterator[bytes]:
    yield struct.pack("<Q", len(cameras))
    for index, (camera, name) in enumerate(zip(cameras, names, strict=True)):
        x, y, z, w = Rotation.from_matrix(camera.viewmat[:3, :3]).as_quat()
        translation = camera.viewmat[:3, 3]
        yield struct.pack("<i7di", index + 1, w, x, y, z, *translation, index + 1)
        yield name.encode() + b"\0" + struct.pack("<Q", 0)


def _points(capture: Capture) -> Iterator[bytes]:
    xyz, rgb = capture.points
    yield struct.pack("<Q", len(xyz))
    for index, (place, color) in enumerate(zip(xyz.astype(np.float64), rgb, strict=True)):
        # The error is not known; -1 is what COLMAP itself writes for that.
        yield struct.pack("<Q3d3BdQ", index + 1, *place, *color.tolist(), -1.0, 0)
