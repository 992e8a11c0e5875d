"""The views of a capture on the device, which are held out, and in which order they come."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyopencl.array as cla
from jaxtyping import Float32

from luxcore.cameras import Camera
from luxcore.capture import Frame
from luxcore.errors import InputError
from luxcore.files.photos import read_photo
from luxcore.splats.device import Device


@dataclass(frozen=True)
class Split:
    """Indices of the views to train on and of those to measure on."""

    training: tuple[int, ...]
    held_out: tuple[int, ...]


def split_views(count: int, holdout_every: int) -> Split:
    """Every `holdout_every`-th view is held out; none where there are fewer views than that."""
    held_out = tuple(range(holdout_every - 1, count, holdout_every))
    return Split(tuple(v for v in range(count) if v not in held_out), held_out)


def view_at(iteration: int, views: Sequence[int], seed: int) -> int:
    """The view of an iteration: every epoch visits all once, in an order of its own.

    A function of its arguments alone, so that a resumed run sees the same views.
    """
    epoch, position = divmod(iteration, len(views))
    order = np.random.Generator(np.random.PCG64([seed, 1, epoch])).permutation(len(views))
    return views[int(order[position])]


def fitted_camera(camera: Camera, max_side: int) -> Camera:
    """The camera with its longer side at most `max_side` pixels."""
    longest = max(camera.width, camera.height)
    if longest <= max_side:
        return camera
    scale = max_side / longest
    return camera.resized(max(1, round(camera.width * scale)), max(1, round(camera.height * scale)))


def read_view(frame: Frame, camera: Camera) -> Float32[np.ndarray, "h w 3"]:
    """The photo of a frame, display-referred, averaged down to the size of `camera`."""
    photo = read_photo(frame.image_path)
    expected = (frame.camera.height, frame.camera.width)
    if photo.shape[:2] != expected:
        raise InputError(
            f"{frame.image_path} is {photo.shape[1]}x{photo.shape[0]}, "
            f"its camera is {expected[1]}x{expected[0]}."
        )
    return resized(photo, camera)


def resized(image: Float32[np.ndarray, "h w c"], camera: Camera) -> Float32[np.ndarray, "h2 w2 c"]:
    """`image` averaged to the pixel grid of `camera`."""
    if image.shape[:2] == (camera.height, camera.width):
        return image
    import cv2

    size = (camera.width, camera.height)
    # By three channels, as OpenCV averages at most four unless sides divide evenly.
    parts = [
        cv2.resize(image[..., k : k + 3], size, interpolation=cv2.INTER_AREA)
        for k in range(0, image.shape[2], 3)
    ]
    return np.concatenate([part.reshape(*size[::-1], -1) for part in parts], axis=2)


@dataclass(frozen=True)
class Views:
    """Cameras and device targets, one per view, all of one capture."""

    cameras: tuple[Camera, ...]
    targets: tuple[cla.Array, ...]


def load_views(device: Device, frames: Sequence[Frame], max_side: int) -> Views:
    """Every photo on the device: 12 bytes per pixel."""
    cameras = tuple(fitted_camera(frame.camera, max_side) for frame in frames)
    photos = (read_view(f, c) for f, c in zip(frames, cameras, strict=True))
    return Views(cameras, tuple(device.array(photo) for photo in photos))
