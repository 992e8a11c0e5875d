"""Photos whose poses are known become the undistorted views of a capture."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from luxcore.cameras import Camera
from luxcore.capture.photo_folder import reduced
from luxcore.capture.sparse import Lens
from luxcore.capture.store import View
from luxcore.capture.undistort import scaled, undistort
from luxcore.errors import InputError
from luxcore.files.photos import read_photo


@dataclass(frozen=True)
class PosedPhoto:
    """A photo file, the lens it was taken through, and c2w [4, 4] (OpenCV axes)."""

    name: str
    path: Path
    lens: Lens
    c2w: np.ndarray


def to_views(photos: Iterable[PosedPhoto], longest_side: int) -> Iterator[View]:
    """Read, reduce and undistort one photo after the other.

    Raises InputError when a photo is unreadable or of another size than its camera.
    """
    for posed in photos:
        photo = read_photo(posed.path)
        height, width = photo.shape[:2]
        if (width, height) != (posed.lens.width, posed.lens.height):
            raise InputError(
                f"{posed.path} is {width}x{height}, its camera says "
                f"{posed.lens.width}x{posed.lens.height}."
            )
        photo = reduced(photo, longest_side)
        height, width = photo.shape[:2]
        photo, lens = undistort(posed.name, photo, scaled(posed.lens, width, height))
        camera = Camera(lens.fx, lens.fy, lens.cx, lens.cy, width, height, posed.c2w)
        yield View(posed.name, photo, camera)
