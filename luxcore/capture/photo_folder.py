"""A folder of photos from a stranger: which can be used, at which size, with which focal length."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from luxcore.capture.store import Skipped
from luxcore.errors import FormatError, InputError
from luxcore.files.photos import (
    PHOTO_SUFFIXES,
    list_photos,
    open_picture,
    read_photo,
    write_png,
)

MIN_SIDE = 48
"""Pixels; a smaller picture has too few features to be placed."""

MAX_FOLDERS = 2000
_EXIF_IFD, _FOCAL_35MM = 0x8769, 0xA405


@dataclass(frozen=True)
class StagedPhoto:
    """A readable photo, upright and reduced, waiting in a work folder under `path`."""

    name: str
    path: Path
    width: int
    height: int
    focal_px: float | None
    """From the 35 mm equivalent in EXIF, in pixels of the reduced photo."""


def find_photos(source: Path) -> list[Path]:
    """The photos of `source`: in it, or in the only folder below it that holds any.

    Raises InputError when there are none, or in several folders.
    """
    source = Path(source)
    if not source.is_dir():
        raise InputError(f"{source} is not a folder.")
    folders = sorted({p.parent for p in _walk(source) if p.suffix.lower() in PHOTO_SUFFIXES})
    if not folders or source in folders:
        return list_photos(source)
    if len(folders) > 1:
        names = ", ".join(str(f.relative_to(source)) for f in folders[:4])
        raise InputError(f"{source} holds photos in {len(folders)} folders ({names}); name one.")
    return list_photos(folders[0])


def stage_photos(
    photos: list[Path], work: Path, longest_side: int
) -> tuple[list[StagedPhoto], list[Skipped]]:
    """Write each readable photo as an upright PNG into `work`; tell what was left out and why."""
    staged: list[StagedPhoto] = []
    skipped: list[Skipped] = []
    for path in photos:
        try:
            photo = read_photo(path)
        except InputError as error:
            skipped.append(Skipped(path.name, _reason(path, error)))
            continue
        height, width = photo.shape[:2]
        if min(height, width) < MIN_SIDE:
            reason = f"{width}x{height} is smaller than {MIN_SIDE} pixels"
            skipped.append(Skipped(path.name, reason))
            continue
        photo = reduced(photo, longest_side)
        target = work / f"{len(staged):04d}.png"
        write_png(target, photo)
        height, width = photo.shape[:2]
        focal = _focal_px(path, max(width, height))
        staged.append(StagedPhoto(path.name, target, width, height, focal))
    return staged, skipped


def reduced(photo: Float[np.ndarray, "h w 3"], longest_side: int) -> np.ndarray:
    """The photo with its longest side at most `longest_side` pixels, area-averaged."""
    import cv2

    height, width = photo.shape[:2]
    factor = longest_side / max(height, width)
    if factor >= 1:
        return photo
    size = max(1, round(width * factor)), max(1, round(height * factor))
    return cv2.resize(photo, size, interpolation=cv2.INTER_AREA)


def _walk(source: Path) -> list[Path]:
    # Bounded, so that a home folder given by mistake ends in a sentence instead of a long search.
    found, folders = [], [source]
    for count, folder in enumerate(folders):
        if count > MAX_FOLDERS:
            raise InputError(f"{source} holds more than {MAX_FOLDERS} folders; name the one.")
        for entry in sorted(folder.iterdir()):
            hidden = entry.name.startswith(".") or entry.name == "masks"
            if entry.is_dir() and not entry.is_symlink() and not hidden:
                folders.append(entry)
            elif entry.is_file():
                found.append(entry)
    return found


def _reason(path: Path, error: InputError) -> str:
    return " ".join(str(error).replace(f"{path} ", "").rstrip(".").split())


def _focal_px(path: Path, longest_side: int) -> float | None:
    try:
        with open_picture(path) as image:
            value = image.getexif().get_ifd(_EXIF_IFD).get(_FOCAL_35MM, 0)
        focal_mm = float(value)
    # A photo whose pixels can be read is used, whatever its EXIF is like.
    except (FormatError, TypeError, ValueError, ZeroDivisionError):
        return None
    # 36 mm is the long side of the film that the equivalent refers to.
    return longest_side * focal_mm / 36.0 if 8 <= focal_mm <= 400 else None
