"""Masks that need not be guessed: a rendered room's own, or a folder that the user drew."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from luxcore.capture.drawn_masks import mask_files
from luxcore.capture.store import Capture
from luxcore.errors import FormatError, InputError
from luxcore.files.exr import read_exr
from luxcore.files.json_numbers import flag
from luxcore.files.json_object import read_object
from luxcore.files.photos import read_mask, read_photo
from luxcore.light.agx import agx_inverse
from luxcore.light.burning import burning_lamps
from luxcore.masks.references import best_views, photo_sharpness
from luxcore.masks.store import FoundLamp, Mask
from luxcore.settings.masks import MasksSettings


def truth_lamps(capture: Capture, settings: MasksSettings) -> list[FoundLamp]:
    """The lamps of a rendered room that any view sees, by their fixtures.

    Raises InputError when the capture has no truth, FormatError when that is incomplete.
    """
    if capture.truth is None:
        raise InputError(f"{capture.root} has no truth to take masks from.")
    lamps = _true_lamps(capture.truth / "lights.json")
    masks: list[dict[int, Mask]] = [{} for _ in lamps]
    for view in range(len(capture.frames)):
        path = capture.truth / f"{view:04d}.masks.exr"
        layers = read_exr(path)
        for light, seen in enumerate(masks):
            mask = _truth_mask(path, layers, light)
            if mask.mean() >= settings.min_area:
                seen[view] = mask
    sharpness = capture_sharpness(capture)
    return [
        FoundLamp(
            name=name,
            on=on,
            masks=seen,
            references=best_views(seen, sharpness, settings.references),
            truth_light=light,
        )
        for light, ((name, on), seen) in enumerate(zip(lamps, masks, strict=True))
        if seen
    ]


def folder_lamps(capture: Capture, folder: Path, settings: MasksSettings) -> list[FoundLamp]:
    """The user's `NNNN_LL.png` masks (view, lamp). On or off is judged from the reference photos.

    Raises InputError for a name, view, size or mask that cannot be used.
    """
    files = mask_files(Path(folder), len(capture.frames))
    sharpness = capture_sharpness(capture)
    lamps: dict[int, dict[int, Mask]] = {}
    for view, lamp, path in files:
        camera = capture.frames[view].camera
        mask = read_mask(path, (camera.height, camera.width))
        lamps.setdefault(lamp, {})[view] = mask
    return [
        _drawn_lamp(capture, f"lamp_{index}", lamps[key], sharpness, settings)
        for index, key in enumerate(sorted(lamps))
    ]


def capture_sharpness(capture: Capture) -> dict[int, float]:
    """Sharpness of every view's photo."""
    photos = (read_photo(frame.image_path) for frame in capture.frames)
    return {view: photo_sharpness(photo) for view, photo in enumerate(photos)}


def _true_lamps(path: Path) -> list[tuple[str, bool]]:
    """Name of every lamp, and whether it burns."""
    records = read_object(path).get("lamps", [])
    try:
        return [
            (str(record.get("name", f"lamp_{light}")), flag(record["on"], f"on of lamp {light}"))
            for light, record in enumerate(records)
        ]
    except (KeyError, TypeError, AttributeError) as error:
        raise FormatError(f"{path} is not a list of lamps: {error!r}.") from error
    except ValueError as error:
        raise FormatError(f"{path}: {error}.") from error


def _truth_mask(path: Path, layers: dict[str, np.ndarray], light: int) -> Mask:
    for kind in ("fixture", "emitter"):
        layer = layers.get(f"{kind}_{light:02d}")
        if layer is None:
            raise FormatError(f"{path} lacks the part {kind}_{light:02d}.")
        mask = layer[..., 0] > 0.5
        if mask.any():
            break
    return mask


def _drawn_lamp(
    capture: Capture,
    name: str,
    masks: dict[int, Mask],
    sharpness: dict[int, float],
    settings: MasksSettings,
) -> FoundLamp:
    references = best_views(masks, sharpness, settings.references)
    seen = {view: masks[view] for view in references}
    return FoundLamp(name=name, on=_looks_on(capture, seen), masks=masks, references=references)


def _looks_on(capture: Capture, masks: dict[int, Mask]) -> bool:
    """Whether the lamp burns in at least half of the photos that it is masked in."""
    burns = [
        burning_lamps(agx_inverse(read_photo(capture.frames[view].image_path)), mask[None])[0]
        for view, mask in masks.items()
    ]
    return bool(np.mean(burns) >= 0.5)
