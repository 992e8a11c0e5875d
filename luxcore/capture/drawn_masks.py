"""Lamp masks that the user drew beside the photos, carried to the views they became.

`masks/NNNN_LL.png` in the source: NNNN counts the photos in name order (the frames of a given
model), LL the lamps. In the capture NNNN is the view.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Bool

from luxcore.capture.photo_folder import reduced
from luxcore.capture.posed import PosedPhoto
from luxcore.capture.sparse import Lens
from luxcore.capture.undistort import scaled, undistort
from luxcore.errors import InputError
from luxcore.files.photos import read_mask, write_png

FOLDER = "masks"
MASK_NAME = re.compile(r"(\d{4})_(\d{2})\.png")


def mask_files(folder: Path, views: int) -> list[tuple[int, int, Path]]:
    """(view, lamp, file) of every mask in `folder`.

    Raises InputError for a folder without masks, another name, or a view that does not exist.
    """
    files = sorted(folder.glob("*.png")) if folder.is_dir() else []
    if not files:
        raise InputError(f"{folder} holds no masks named NNNN_LL.png (view, lamp).")
    found = []
    for path in files:
        match = MASK_NAME.fullmatch(path.name)
        if match is None:
            raise InputError(f"{path} is not named NNNN_LL.png (view, lamp).")
        view, lamp = int(match[1]), int(match[2])
        if view >= views:
            raise InputError(f"{path} is for view {view}, the capture has {views} views.")
        found.append((view, lamp, path))
    return found


def carry_masks(
    drawn: Path, order: Sequence[str], placed: Sequence[PosedPhoto], side: int, out: Path
) -> None:
    """Write the masks of the placed photos into `out`, reduced and undistorted like their photos.

    `order` are the names of all photos of the source. Masks of photos that were not placed are
    left out. Raises InputError for masks that are empty or of another shape than their photo.
    """
    views = {photo.name: (index, photo.lens) for index, photo in enumerate(placed)}
    for number, lamp, path in mask_files(drawn, len(order)):
        if order[number] in views:
            view, lens = views[order[number]]
            write_png(out / f"{view:04d}_{lamp:02d}.png", _as_stored(path, lens, side))


def _as_stored(path: Path, lens: Lens, side: int) -> Bool[np.ndarray, "h w"]:
    import cv2

    mask = read_mask(path).astype(np.float32)
    height, width = mask.shape
    # Photos may have been reduced before; a mask of the original size has the same proportions.
    if abs(width * lens.height - height * lens.width) > 2 * max(height, width):
        raise InputError(
            f"{path} is {width}x{height}, the photo is {lens.width}x{lens.height} or a multiple."
        )
    sized = cv2.resize(mask, (lens.width, lens.height), interpolation=cv2.INTER_AREA)
    small = reduced(np.repeat(sized[..., None], 3, axis=2), side)
    flat, _ = undistort(path.name, small, scaled(lens, small.shape[1], small.shape[0]))
    return flat[..., 0] > 0.5
