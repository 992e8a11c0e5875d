"""COLMAP's sparse models: cameras, images and points3D, binary or text, read without trust.

Counts are compared with the bytes that are left before anything is allocated, and names must stay
inside the photo folder. Observations and tracks are skipped: nothing here needs them.
Layout: https://colmap.github.io/format.html
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from luxcore.capture.names import inside
from luxcore.capture.points import Points
from luxcore.capture.sparse import (
    MODELS,
    Lens,
    PosedImage,
    SparseModel,
    check_spread,
    lens_from_colmap,
    pose_from_colmap,
)
from luxcore.errors import FormatError

Record = tuple[str, int, tuple[float, ...], tuple[float, ...]]
"""Of an image: name, camera id, quaternion w x y z, translation."""

_TRACK_ELEMENT, _OBSERVATION = 8, 24
_MAX_NAME = 1024


def find_model(folder: Path) -> Path | None:
    """The folder with the model: `folder`, its sparse/0 or its sparse; None where there is none."""
    candidates = (folder, folder / "sparse" / "0", folder / "sparse")
    for candidate in candidates:
        for suffix in (".bin", ".txt"):
            if all((candidate / f"{part}{suffix}").is_file() for part in ("cameras", "images")):
                return candidate
    return None


def read_model(folder: Path, image_root: Path) -> SparseModel:
    """A checked model. Raises FormatError naming the file, the image and the fact."""
    binary = (folder / "cameras.bin").is_file()
    suffix = ".bin" if binary else ".txt"
    cameras_path, images_path = folder / f"cameras{suffix}", folder / f"images{suffix}"
    try:
        lenses = _cameras_bin(cameras_path) if binary else _cameras_txt(cameras_path)
        records = list(_images_bin(images_path) if binary else _images_txt(images_path))
        points = read_points3d(folder)
    except (struct.error, ValueError, IndexError, UnicodeDecodeError, OverflowError) as error:
        raise FormatError(f"{folder} is not a readable COLMAP model: {error}.") from error
    images = tuple(_posed(images_path, image_root, r, lenses) for r in sorted(records))
    check_spread(images_path, images)
    return SparseModel(images, points)


def read_points3d(folder: Path) -> Points:
    """The points of a model; none where it has no file of them."""
    points = Points(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint8))
    for name, read in (("points3D.bin", _points_bin), ("points3D.txt", _points_txt)):
        if (folder / name).is_file():
            points = read(folder / name)
            break
    if not np.isfinite(points.xyz).all():
        raise FormatError(f"{folder} has points that are not finite.")
    return points


def _posed(path: Path, root: Path, record: Record, lenses: dict[int, Lens]) -> PosedImage:
    name, camera_id, qvec, tvec = record
    inside(root, name, path)
    if camera_id not in lenses:
        raise FormatError(f"{path}: image {name!r:.80} has camera {camera_id}, which is missing.")
    return PosedImage(name, lenses[camera_id], pose_from_colmap(path, name, qvec, tvec))


class _Bytes:
    """Little-endian values from a file, never past its end."""

    def __init__(self, path: Path) -> None:
        self.path, self.raw, self.at = path, path.read_bytes(), 0

    def take(self, layout: str) -> tuple:
        values = struct.unpack_from("<" + layout, self.raw, self.at)
        self.at += struct.calcsize("<" + layout)
        return values

    def count(self, smallest: int) -> int:
        """A count of records of at least `smallest` bytes each."""
        (count,) = self.take("Q")
        left = (len(self.raw) - self.at) // smallest
        if count > left:
            raise FormatError(f"{self.path} claims {count} records, its bytes hold {left}.")
        return count

    def name(self) -> str:
        end = self.raw.find(b"\0", self.at, self.at + _MAX_NAME)
        if end < 0:
            raise FormatError(f"{self.path} has an image name without an end.")
        text = self.raw[self.at : end].decode("utf-8")
        self.at = end + 1
        return text

    def skip(self, size: int) -> None:
        """Pass over `count()` records of `size` bytes."""
        count = self.count(size)
        self.at += count * size


def _cameras_bin(path: Path) -> dict[int, Lens]:
    data, lenses = _Bytes(path), {}
    for _ in range(data.count(24)):
        camera_id, model, width, height = data.take("iiQQ")
        name, parameters = MODELS.get(model, (f"number {model}", 0))
        lenses[camera_id] = lens_from_colmap(path, name, width, height, data.take("d" * parameters))
    return lenses


def _images_bin(path: Path) -> Iterator[Record]:
    data = _Bytes(path)
    for _ in range(data.count(64)):
        _, *pose, camera_id = data.take("i7di")
        yield data.name(), camera_id, tuple(pose[:4]), tuple(pose[4:])
        data.skip(_OBSERVATION)


def _points_bin(path: Path) -> Points:
    data = _Bytes(path)
    count = data.count(51)
    xyz, rgb = np.empty((count, 3), np.float32), np.empty((count, 3), np.uint8)
    for index in range(count):
        _, *xyz[index], red, green, blue, _ = data.take("Q3d3Bd")
        rgb[index] = red, green, blue
        data.skip(_TRACK_ELEMENT)
    return Points(xyz, rgb)


def _rows(path: Path) -> list[list[str]]:
    lines = path.read_text(encoding="utf-8").splitlines()
    return [line.split() for line in lines if not line.startswith("#")]


def _numbers(words: list[str], kind: Callable[[str], float] = float) -> tuple[float, ...]:
    return tuple(kind(word) for word in words)


def _cameras_txt(path: Path) -> dict[int, Lens]:
    rows = [row for row in _rows(path) if row]
    return {
        int(row[0]): lens_from_colmap(path, row[1], int(row[2]), int(row[3]), _numbers(row[4:]))
        for row in rows
    }


def _images_txt(path: Path) -> Iterator[Record]:
    # Each image takes two lines; the second, its observations, may be empty.
    rows = _rows(path)
    while rows and not rows[-1]:
        rows.pop()
    for row in rows[::2]:
        yield " ".join(row[9:]), int(row[8]), _numbers(row[1:5]), _numbers(row[5:8])


def _points_txt(path: Path) -> Points:
    rows = [row for row in _rows(path) if row]
    xyz = np.array([_numbers(row[1:4]) for row in rows], np.float32).reshape(-1, 3)
    rgb = np.array([_numbers(row[4:7]) for row in rows]).reshape(-1, 3)
    if ((rgb < 0) | (rgb > 255)).any():
        raise FormatError(f"{path} has colours outside 0..255.")
    return Points(xyz, rgb.astype(np.uint8))
