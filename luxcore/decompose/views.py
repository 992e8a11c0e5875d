"""Views of a capture as the models want them: photo in linear light, masks, geometry."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from luxcore.capture import Capture
from luxcore.errors import FormatError
from luxcore.files.exr import read_exr
from luxcore.files.photos import read_photo
from luxcore.light.agx import agx_inverse
from luxcore.masks.store import LampMasks
from luxcore.models.interface import Geometry, View


def exposed_photo(capture: Capture, view: int) -> Float[np.ndarray, "h w 3"]:
    """The photo in linear light where the exposure is 1: the inverse of AgX."""
    photo = read_photo(capture.frames[view].image_path)
    return np.asarray(agx_inverse(photo), np.float32)


def load_view(capture: Capture, masks: LampMasks, splat: Path | None, view: int) -> View:
    """A view with all lamps' masks and, where stage 1 of the splats has run, its geometry."""
    photo = exposed_photo(capture, view)
    on = np.array([lamp.on for lamp in masks.lamps], bool)
    planes = view_masks(masks, view, (photo.shape[0], photo.shape[1]))
    return View(photo, planes, on, _geometry(capture, splat, view))


def view_masks(masks: LampMasks, view: int, size: tuple[int, int]) -> Bool[np.ndarray, "k h w"]:
    """Masks of all lamps in a view; empty where it does not see one."""
    planes = np.zeros((len(masks.lamps), *size), bool)
    for lamp in range(len(masks.lamps)):
        mask = masks.mask(view, lamp)
        if mask is not None:
            if mask.shape != size:
                raise FormatError(f"{masks.path(view, lamp)} is not as large as the photo.")
            planes[lamp] = mask
    return planes


def _geometry(capture: Capture, splat: Path | None, view: int) -> Geometry | None:
    path = None if splat is None else splat / "depth" / f"{view:04d}.exr"
    if path is None or not path.is_file():
        return None
    layers, camera = read_exr(path), capture.frames[view].camera
    try:
        depth, normal = layers["depth_m"][..., 0], layers["normal"][..., :3]
    except KeyError as error:
        raise FormatError(f"{path} lacks the part {error}.") from error
    return Geometry(camera.resized(depth.shape[1], depth.shape[0]), depth, normal)
