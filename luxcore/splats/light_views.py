"""What stage 2 is fitted to: per view the light images of the fuse stage and the photo."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyopencl.array as cla
from jaxtyping import Float32

from luxcore.cameras import Camera
from luxcore.capture import Capture, Frame
from luxcore.errors import FormatError, InputError
from luxcore.files.exr import read_exr
from luxcore.light.agx import agx_inverse
from luxcore.splats.device import Device
from luxcore.splats.losses.composition import START_CURVE
from luxcore.splats.losses.constants import CLIPPED, PHOTO_CLIPPED
from luxcore.splats.views import fitted_camera, read_view, resized

AMBIENT = "ambient"
_BRIGHT_PERCENTILE = 99.0


def light_names(lamps: int) -> tuple[str, ...]:
    """Names of the M = lamps + 1 layers in order: ambient first."""
    return (AMBIENT, *(f"light_{index:02d}" for index in range(lamps)))


@dataclass(frozen=True)
class LightViews:
    """Device targets of all views. Light m of a view has radiance `targets · units[m]`."""

    cameras: tuple[Camera, ...]
    targets: tuple[cla.Array, ...]
    """[h, w, 3M] each, linear, divided by the unit of its light."""
    photos: tuple[cla.Array, ...]
    """[h, w, 3] each, display-referred."""
    toned: tuple[cla.Array, ...]
    """[h, w, 3] each: what the composition is compared with, see `toned_photo`."""
    units: Float32[np.ndarray, " m"]

    @property
    def channels(self) -> int:
        """3M."""
        return 3 * len(self.units)


def load_light_views(
    device: Device, capture: Capture, fuse_dir: Path, lamps: int, max_side: int
) -> LightViews:
    """Read `fuse_dir`/0000.exr … and the photos. Raises InputError or FormatError by file.

    A light's unit is about twice its mean radiance over all views, highlights aside: so every
    light is fitted in numbers around one half, and a lamp of 10^4 does not drown the others.
    """
    cameras = tuple(fitted_camera(frame.camera, max_side) for frame in capture.frames)
    images = [
        read_light_images(fuse_dir / f"{index:04d}.exr", frame, camera, lamps)
        for index, (frame, camera) in enumerate(zip(capture.frames, cameras, strict=True))
    ]
    units = light_units(images)
    scale = np.repeat(1 / units, 3)
    targets = tuple(device.array((image * scale).astype(np.float32)) for image in images)
    photos = [read_view(f, c) for f, c in zip(capture.frames, cameras, strict=True)]
    toned = tuple(device.array(toned_photo(photo)) for photo in photos)
    return LightViews(cameras, targets, tuple(device.array(p) for p in photos), toned, units)


def toned_photo(photo: Float32[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "h w 3"]:
    """The photo through the curve T that the composition starts with, instead of AgX.

    The project reads photos as AgX; the paper's T(v) = (v + β)^(1/γ) is not of that shape and,
    compared with AgX photos, bends the lights to make up for it (measured: 1 dB of the recombined
    image). So the photo is taken back to linear light and through the starting T, which then
    learns only how this camera departs from AgX. What the photo clips stays marked as clipped.
    """
    # A photo repeats its colours: the inverse is found once for each of them, to 8 bits.
    codes = np.round(np.clip(photo, 0, 1) * 255).astype(np.int32).reshape(-1, 3)
    packed, where = np.unique(codes @ [1 << 16, 1 << 8, 1], return_inverse=True)
    colors = np.stack([packed >> 16, packed >> 8 & 255, packed & 255], axis=1) / 255
    linear = np.maximum(agx_inverse(colors), 0)
    toned = (linear + START_CURVE.beta) ** (1 / START_CURVE.gamma)
    # Just below or at the mark that the loss reads as "the photo clips here".
    unclipped = np.minimum(toned, np.nextafter(np.float32(CLIPPED), np.float32(0)))
    toned = np.where(colors >= PHOTO_CLIPPED, np.maximum(toned, CLIPPED), unclipped)
    return toned[where].reshape(photo.shape).astype(np.float32)


def read_light_images(
    path: Path, frame: Frame, camera: Camera, lamps: int
) -> Float32[np.ndarray, "h w m3"]:
    """The lights of one view side by side, linear radiance, at the size of `camera`."""
    layers = read_exr(path)
    names = light_names(lamps)
    missing = [name for name in names if name not in layers]
    if missing:
        raise FormatError(f"{path} lacks the layer {missing[0]}.")
    image = np.concatenate([layers[name][..., :3] for name in names], axis=2)
    expected = (frame.camera.height, frame.camera.width)
    if image.shape[:2] != expected or image.shape[2] != 3 * len(names):
        raise FormatError(
            f"{path} must hold {expected[1]}x{expected[0]} rgb layers, got {image.shape}."
        )
    if not np.isfinite(image).all():
        raise FormatError(f"{path} has values that are not finite.")
    return np.maximum(resized(image, camera), 0)


def light_units(images: Sequence[Float32[np.ndarray, "h w m3"]]) -> Float32[np.ndarray, " m"]:
    """Twice the mean radiance of each light, its brightest percent counted as the 99th percentile.

    A light that adds nothing anywhere gets the unit 1.
    """
    units = []
    for first in range(0, images[0].shape[2], 3):
        values = np.concatenate([image[..., first : first + 3].ravel() for image in images])
        ceiling = np.percentile(values, _BRIGHT_PERCENTILE)
        mean = float(np.minimum(values, ceiling).mean(dtype=np.float64))
        units.append(2 * mean if mean > 1e-9 else 1.0)
    return np.array(units, np.float32)


def read_exposure(fuse_dir: Path, capture: Capture) -> float:
    """g of image = AgX(g · radiance): from fuse.json, else the capture's, else 1."""
    path = fuse_dir / "fuse.json"
    if not path.is_file():
        raise InputError(f"{path} does not exist.")
    try:
        exposure = json.loads(path.read_text(encoding="utf-8")).get("exposure")
        value = exposure if exposure is not None else capture.exposure
        number = 1.0 if value is None else float(value)
    except (ValueError, AttributeError, TypeError) as error:
        raise FormatError(f"{path} has no usable exposure: {error}.") from error
    if not (np.isfinite(number) and number > 0):
        raise FormatError(f"{path}: exposure must be positive, got {number}.")
    return number
