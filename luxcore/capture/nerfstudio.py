"""nerfstudio's `transforms.json` with OpenCV distortion, as its tools write it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from luxcore.capture.names import inside
from luxcore.capture.points import Points, read_points
from luxcore.capture.posed import PosedPhoto
from luxcore.capture.sparse import Lens
from luxcore.capture.store import checked_camera, frame_records
from luxcore.errors import FormatError
from luxcore.files.json_numbers import finite
from luxcore.files.json_object import read_object

_MODELS = {"OPENCV", "PINHOLE", "SIMPLE_PINHOLE"}
_SUFFIXES = ("", ".png", ".jpg", ".jpeg")


def read_nerfstudio(path: Path) -> tuple[list[PosedPhoto], Points]:
    """Photos in the order of the file, in its own world, and its points where it names any.

    Raises FormatError naming the file, the frame and the fact.
    """
    transforms = read_object(path)
    records = frame_records(path, transforms)
    if len(records) < 2:
        raise FormatError(f"{path} holds {len(records)} frame; at least two are needed.")
    model = transforms.get("camera_model", "OPENCV")
    if not isinstance(model, str) or model not in _MODELS:
        raise FormatError(f"{path} has camera_model {model!r:.40}; known are OPENCV and PINHOLE.")
    photos = [_photo(path, record, transforms) for record in records]
    if np.ptp(np.stack([p.c2w[:3, 3] for p in photos]), axis=0).max() < 1e-9:
        raise FormatError(f"{path} puts all {len(photos)} frames in one place.")
    return photos, _points(path, transforms)


def _photo(path: Path, record: dict[str, Any], transforms: dict[str, Any]) -> PosedPhoto:
    camera = checked_camera(path, record, transforms)
    name = record["file_path"].removeprefix("./")
    file = inside(path.parent, name, path)
    found = [f for f in (file.with_name(file.name + s) for s in _SUFFIXES) if f.is_file()]
    if not found:
        raise FormatError(f"{path} names {name:.80}, which does not exist.")
    merged = {**transforms, **record}
    try:
        distortion = tuple(finite(merged.get(k, 0.0), k) for k in ("k1", "k2", "p1", "p2", "k3"))
    except ValueError as error:
        raise FormatError(f"{path}: {name:.80}: {error}.") from error
    size = camera.width, camera.height
    lens = Lens(*size, camera.fx, camera.fy, camera.cx, camera.cy, distortion)
    return PosedPhoto(found[0].name, found[0], lens, camera.c2w)


def _points(path: Path, transforms: dict[str, Any]) -> Points:
    name = transforms.get("ply_file_path")
    if name is None:
        return Points(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint8))
    return read_points(inside(path.parent, name, path))
