"""A photographer's own brackets: exposure times, the camera's response, and the merge.

The response is recovered by OpenCV's CalibrateDebevec (Debevec and Malik 1997); the merge is
`merge_brackets`, as for the models' exposures.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from luxcore.errors import InputError
from luxcore.files.photos import open_picture, read_photo
from luxcore.light.hdr import Merged, merge_brackets
from luxcore.light.response import CurveResponse

SAMPLES = 100
MIN_SIDE_PX, MAX_ASPECT = 10, 100
"""OpenCV spreads the samples over a grid of the picture's proportions, one to a pixel at most."""
SHORTEST_S, LONGEST_S = 1e-9, 1e6
SMOOTHNESS = 20.0
_EXIF_FOLDER = 0x8769
_EXPOSURE_TIME, _F_NUMBER, _SENSITIVITY = 33434, 33437, 34855


def merge_photos(paths: Sequence[Path], times_s: Sequence[float] | None = None) -> Merged:
    """Linear radiance of a bracket, 1 at the middle value of a photo exposed for one second.

    `times_s` are exposure times in seconds; without them EXIF gives time, aperture and sensitivity.
    Raises InputError for one photo, mixed or too small sizes, missing or equal times, FormatError
    for no photo.
    """
    if len(paths) < 2:
        raise InputError(f"a bracket needs at least two photos, got {len(paths)}.")
    if times_s is None:
        times_s = [exif_exposure(path) for path in paths]
    if len(times_s) != len(paths):
        raise InputError(f"{len(paths)} photos came with {len(times_s)} exposure times.")
    if len(set(times_s)) < 2:
        raise InputError("all photos of the bracket have the same exposure; nothing can be merged.")
    photos = [read_photo(path) for path in paths]
    for path, photo in zip(paths, photos, strict=True):
        if photo.shape != photos[0].shape:
            raise InputError(
                f"{path} is {photo.shape[1]}x{photo.shape[0]}, "
                f"{paths[0]} is {photos[0].shape[1]}x{photos[0].shape[0]}."
            )
    _check_size(paths[0], photos[0])
    response = CurveResponse(recover_response(photos, times_s))
    return merge_brackets(photos, np.log2(np.asarray(times_s, float)).tolist(), response)


def _check_size(path: Path, photo: np.ndarray) -> None:
    """Refuse what the response's grid of pixels does not fit on."""
    height, width = photo.shape[:2]
    short, long = sorted((height, width))
    if short < MIN_SIDE_PX or long > MAX_ASPECT * short:
        raise InputError(
            f"{path} is {width}x{height}; a bracket needs at least {MIN_SIDE_PX} pixels a side, "
            f"and none longer than {MAX_ASPECT} times the other."
        )


def recover_response(
    photos: Sequence[Float[np.ndarray, "h w 3"]], times_s: Sequence[float]
) -> Float[np.ndarray, "256 3"]:
    """Exposure for each 8-bit value of each channel, 1 at value 128, never falling.

    Solved by OpenCV on a grid of pixels; a curve that dips in its noisy ends is made level there,
    so that a brighter value never means less light.
    """
    import cv2

    stack = [np.ascontiguousarray(np.round(p * 255).astype(np.uint8)) for p in photos]
    calibrate = cv2.createCalibrateDebevec(samples=SAMPLES, lambda_=SMOOTHNESS, random=False)
    curve = calibrate.process(stack, times=np.asarray(times_s, np.float32))[:, 0].astype(np.float64)
    if not np.isfinite(curve).all() or (curve <= 0).any():
        raise InputError("the camera's response could not be recovered from these photos.")
    return np.maximum.accumulate(curve, axis=0)


def exif_exposure(path: Path) -> float:
    """Seconds of exposure at f/1 and ISO 100 from EXIF. Raises InputError if there is no time."""
    with open_picture(path) as image:
        tags = image.getexif().get_ifd(_EXIF_FOLDER)
    time = _number(tags.get(_EXPOSURE_TIME))
    if time is None:
        raise InputError(f"{path} has no exposure time in its EXIF data; give --times.")
    aperture, sensitivity = _number(tags.get(_F_NUMBER)), _number(tags.get(_SENSITIVITY))
    return time * (sensitivity or 100.0) / 100.0 / (aperture or 1.0) ** 2


def parse_times(text: str) -> list[float]:
    """Seconds of "1/30,1/60,0.5". Raises InputError."""
    times = []
    for item in text.split(","):
        shown = f"{item.strip()!r:.80}"
        try:
            time = _seconds(item)
        except (ValueError, ZeroDivisionError) as error:
            raise InputError(f"exposure time {shown} is not like 1/30 or 0.5.") from error
        if not SHORTEST_S <= time <= LONGEST_S:
            raise InputError(
                f"exposure time {shown} must be {SHORTEST_S:g} to {LONGEST_S:g} seconds."
            )
        times.append(time)
    return times


def _seconds(text: str) -> float:
    # Not a Fraction: of 1e-999999999 that calculates every digit.
    over, slash, under = text.partition("/")
    return float(over) / float(under) if slash else float(text)


def _number(value: object) -> float | None:
    """A positive EXIF number, or None for what is absent, zero or damaged."""
    if isinstance(value, tuple):
        value = value[0] if value else None
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return number if np.isfinite(number) and number > 0 else None
