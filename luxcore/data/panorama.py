"""Perspective photos out of equirectangular panoramas, exact at the ±180° seam and at the poles.

Axes: a panorama's centre looks along +x with z up; its left edge has azimuth +π and azimuth falls
to the right. A photo's camera has OpenCV axes. Angles in degrees in names that end in `_deg`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from luxcore.errors import InputError


def view_rotation(
    azimuth_deg: float, elevation_deg: float, roll_deg: float = 0.0
) -> Float[np.ndarray, "3 3"]:
    """Camera-to-panorama rotation that looks in a direction, level but for `roll_deg`.

    Defined at the poles too: there the azimuth says where the image's bottom or top points.
    """
    phi, theta, roll = np.radians([azimuth_deg, elevation_deg, roll_deg])
    forward = np.array([np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi), np.sin(theta)])
    right = np.array([np.sin(phi), -np.cos(phi), 0.0])
    down = np.cross(forward, right)
    c, s = np.cos(roll), np.sin(roll)
    return np.stack([c * right + s * down, c * down - s * right, forward], axis=1)


@lru_cache(maxsize=64)
def pixel_directions(fov_x_deg: float, width: int, height: int) -> Float[Tensor, "h w 3"]:
    """Unit view directions of all pixels in camera axes; square pixels, centred principal point."""
    if not 0 < fov_x_deg < 180:
        raise InputError(f"field of view must be above 0 and below 180 degrees, got {fov_x_deg}.")
    focal = focal_length(fov_x_deg, width)
    x = (torch.arange(width, dtype=torch.float64) + 0.5 - width / 2) / focal
    y = (torch.arange(height, dtype=torch.float64) + 0.5 - height / 2) / focal
    rays = torch.stack(
        [x.expand(height, width), y[:, None].expand(height, width), torch.ones(height, width)], -1
    )
    return (rays / rays.norm(dim=-1, keepdim=True)).float()


def focal_length(fov_x_deg: float, width: int) -> float:
    """Focal length in pixels."""
    return 0.5 * width / math.tan(math.radians(fov_x_deg) / 2)


def sample_perspective(
    panorama: Float[Tensor, "h w c"],
    rotation: Float[np.ndarray, "3 3"],
    fov_x_deg: float,
    width: int,
    height: int,
    *,
    nearest: bool = False,
) -> Float[Tensor, "height width c"]:
    """The photo [height, width, c] that a pinhole at the panorama's centre takes of it.

    `rotation` turns camera axes into the panorama's. Bilinear between pixel centres, or the
    nearest pixel (for masks and distances, which must not be mixed).
    """
    layers = padded(panorama.movedim(-1, 0))
    return sample_padded(layers, rotation, fov_x_deg, width, height, nearest=nearest).movedim(0, -1)


def padded(layers: Float[Tensor, "c h w"]) -> Float[Tensor, "c h+2 w+2"]:
    """One more pixel on every side: across the seam, and over a pole into the opposite azimuth."""
    if layers.shape[2] % 2:
        raise InputError(f"a panorama must have an even width, got {layers.shape[2]}.")
    half = layers.shape[2] // 2
    top, bottom = layers[:, :1].roll(half, 2), layers[:, -1:].roll(half, 2)
    tall = torch.cat([top, layers, bottom], 1)
    return torch.cat([tall[..., -1:], tall, tall[..., :1]], 2)


def sample_padded(
    layers: Float[Tensor, "c hp wp"],
    rotation: Float[np.ndarray, "3 3"],
    fov_x_deg: float,
    width: int,
    height: int,
    *,
    nearest: bool = False,
) -> Float[Tensor, "c height width"]:
    """`sample_perspective` on the output of `padded`, so that many photos share the padding."""
    grid = panorama_grid(rotation, fov_x_deg, width, height, layers.shape[1:])
    mode = "nearest" if nearest else "bilinear"
    return functional.grid_sample(
        layers[None], grid[None], mode=mode, padding_mode="border", align_corners=True
    )[0]


def panorama_grid(
    rotation: Float[np.ndarray, "3 3"],
    fov_x_deg: float,
    width: int,
    height: int,
    padded_size: Sequence[int],
) -> Float[Tensor, "height width 2"]:
    """Where each pixel of a photo lies in a padded panorama, in grid_sample's coordinates."""
    turn = torch.as_tensor(np.asarray(rotation).T, dtype=torch.float32)
    x, y, z = (pixel_directions(float(fov_x_deg), width, height) @ turn).unbind(-1)
    rows, columns = padded_size[0] - 2, padded_size[1] - 2
    u = (0.5 - torch.atan2(y, x) / (2 * math.pi)) * columns - 0.5
    # atan2 keeps its precision near the poles, where asin(z) loses it.
    v = (0.5 - torch.atan2(z, torch.sqrt(x * x + y * y)) / math.pi) * rows - 0.5
    return torch.stack([(u + 1) * (2 / (columns + 1)) - 1, (v + 1) * (2 / (rows + 1)) - 1], -1)


def depth_from_distance(
    ray_distance_m: Float[Tensor, "h w"], fov_x_deg: float
) -> Float[Tensor, "h w"]:
    """Depth along the camera's z, in metres, of distances to the camera centre."""
    height, width = ray_distance_m.shape
    return ray_distance_m * pixel_directions(float(fov_x_deg), width, height)[..., 2]


def directions_of_pixels(height: int, width: int) -> Float[np.ndarray, "h w 3"]:
    """Unit directions of a panorama's pixels, in the panorama's axes."""
    phi = 2 * np.pi * (0.5 - (np.arange(width) + 0.5) / width)[None]
    theta = np.pi * (0.5 - (np.arange(height) + 0.5) / height)[:, None]
    return np.stack(
        [np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi), np.sin(theta) + 0 * phi], -1
    )
