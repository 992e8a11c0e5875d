"""Captures of rendered rooms as groups of views with known light."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as fn

from luxcore.capture import Capture, load_capture
from luxcore.data.crops import LitCrop
from luxcore.decompose.views import view_masks
from luxcore.errors import FormatError, LuxError
from luxcore.files.exr import read_exr
from luxcore.files.json_numbers import flag
from luxcore.files.json_object import read_object
from luxcore.harmonize.poses import pose_distance
from luxcore.masks.store import LampMasks, load_masks
from luxcore.models.small.surfaces import pinhole_of, pinhole_rays


def capture_group(
    capture_dir: Path, masks_dir: Path, views: int, side_px: int
) -> list[LitCrop] | None:
    """The best reference view of a capture's first lamp and the views nearest to it, with their
    true light and geometry, long side `side_px`. None for a capture without truth."""
    capture, masks = load_capture(capture_dir), load_masks(masks_dir)
    if capture.truth is None or not masks.lamps:
        return None
    if any(lamp.truth_light is None for lamp in masks.lamps):
        return None
    reference = masks.lamps[0].references[0]
    distance = pose_distance([frame.camera for frame in capture.frames])[reference]
    order = sorted(range(len(distance)), key=lambda v: (v != reference, distance[v], v))
    return [true_view(capture, masks, view, side_px) for view in order[:views]]


def true_view(capture: Capture, masks: LampMasks, view: int, side_px: int) -> LitCrop:
    """One view of a rendered capture with its true light, lamps in the order of the masks."""
    if capture.truth is None:
        raise LuxError(f"{capture.root} has no truth.")
    about = read_object(capture.truth / "lights.json")
    layers = read_exr(capture.truth / f"{view:04d}.exr")
    geometry = read_exr(capture.truth / f"{view:04d}.geometry.exr")
    camera = capture.frames[view].camera
    planes = view_masks(masks, view, (camera.height, camera.width))
    try:
        lights = np.stack([layers[f"light_{i:02d}"][..., :3] for i in range(len(about["lamps"]))])
        scale = np.array([lamp["scale"] for lamp in about["lamps"]], np.float32)
        on = np.array([flag(lamp["on"], "on") for lamp in about["lamps"]], bool)
        ambient, exposure = layers["ambient"][..., :3], float(about["exposure"])
        distance, normal = geometry["ray_distance_m"][..., 0], geometry["normal"][..., :3]
    except (KeyError, ValueError) as error:
        raise FormatError(f"{capture.truth}: view {view} has no usable truth: {error}.") from error
    lights = lights * scale[:, None, None]
    chosen = [int(lamp.truth_light or 0) for lamp in masks.lamps]
    rest = [i for i in range(len(on)) if i not in chosen and on[i]]
    rays = pinhole_rays(pinhole_of(camera), *distance.shape)
    depth = distance / rays.norm(dim=0).numpy()
    full = LitCrop(
        camera,
        ambient + lights[rest].sum(0),
        lights[chosen],
        planes,
        on[chosen],
        depth,
        normal,
        tuple(str(about["lamps"][i].get("kind", "lamp")) for i in chosen),
        exposure,
    )
    return smaller(full, side_px)


def smaller(crop: LitCrop, side_px: int) -> LitCrop:
    """The crop with its long side at most `side_px`: light averaged, geometry picked."""
    camera = crop.camera
    scale = side_px / max(camera.width, camera.height)
    if scale >= 1:
        return crop
    size = (max(1, round(camera.height * scale)), max(1, round(camera.width * scale)))
    return LitCrop(
        camera.resized(size[1], size[0]),
        _averaged(crop.ambient[None], size)[0],
        _averaged(crop.lights, size),
        _smaller_masks(crop.masks, size),
        crop.on,
        _picked(crop.depth_m, size),
        _picked(crop.normal, size),
        crop.kinds,
        crop.exposure,
    )


def _smaller_masks(masks: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Pixels that a mask covers by a quarter; of a smaller lamp, those that it covers most."""
    coverage = _averaged(masks[..., None].astype(np.float32), size)[..., 0]
    peak = coverage.max(axis=(1, 2), keepdims=True, initial=0)
    return (coverage >= np.minimum(0.25, peak)) & (coverage > 0)


def _averaged(images: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    if not len(images):
        return np.zeros((0, *size, images.shape[-1]), np.float32)
    planes = torch.from_numpy(np.ascontiguousarray(images, np.float32)).movedim(-1, 1)
    return np.ascontiguousarray(fn.interpolate(planes, size, mode="area").movedim(1, -1).numpy())


def _picked(image: np.ndarray, size: Sequence[int]) -> np.ndarray:
    rows = ((np.arange(size[0]) + 0.5) * image.shape[0] / size[0]).astype(int)
    columns = ((np.arange(size[1]) + 0.5) * image.shape[1] / size[1]).astype(int)
    return image[rows][:, columns]
