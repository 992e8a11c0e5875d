"""Depth and normals of a photo in camera space, and how a lamp stands to them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from luxcore.cameras import Camera
from luxcore.models.small.samples import chw

Pinhole = tuple[float, float, float, float]


@dataclass(frozen=True)
class Surfaces:
    """Geometry of one photo on the network's grid; zeros where unknown.

    `points` are camera-space positions in metres, `normals` unit vectors in camera axes. `trust`
    is 1 for given geometry and less for what was estimated from the photo. `pinhole` is the
    camera's (fx, fy, cx, cy) in pixels of the grid.
    """

    points: Float[Tensor, "3 h w"]
    normals: Float[Tensor, "3 h w"]
    pinhole: Pinhole
    trust: float = 1.0

    @property
    def valid(self) -> Bool[Tensor, "h w"]:
        """Where the surface is known."""
        return (self.points[2] > 0) & (self.normals.abs().sum(0) > 0)


def pinhole_of(camera: Camera) -> Pinhole:
    """The camera's focal lengths and principal point, pixels."""
    return camera.fx, camera.fy, camera.cx, camera.cy


def pinhole_rays(pinhole: Pinhole, height: int, width: int) -> Float[Tensor, "3 h w"]:
    """Camera-space directions of the pixel centres with z = 1."""
    fx, fy, cx, cy = pinhole
    x = (torch.arange(width) + 0.5 - cx) / fx
    y = (torch.arange(height) + 0.5 - cy) / fy
    grid_y, grid_x = torch.meshgrid(y, x, indexing="ij")
    return torch.stack([grid_x, grid_y, torch.ones_like(grid_x)]).float()


def picture_places(
    points: Float[Tensor, "3 ..."], pinhole: Pinhole, height: int, width: int
) -> Float[Tensor, "... 2"]:
    """Where camera-space points are seen, as `grid_sample` counts: -1 to 1 over the picture.

    Points behind the camera are somewhere: ask for their z first.
    """
    fx, fy, cx, cy = pinhole
    x, y, z = points[0], points[1], points[2].clamp_min(1e-3)
    u, v = (fx * x / z + cx) / width, (fy * y / z + cy) / height
    return torch.stack([2 * u - 1, 2 * v - 1], dim=-1)


def surfaces_of(
    depth_m: Float[np.ndarray, "h w"], normal: Float[np.ndarray, "h w 3"], camera: Camera
) -> Surfaces:
    """Camera-space points and normals. Depth that is not finite or not positive counts as unknown.

    `normal` is in world axes.
    """
    depth = torch.from_numpy(np.asarray(depth_m, np.float32))
    depth = torch.where(torch.isfinite(depth) & (depth > 0), depth, torch.zeros_like(depth))
    rotation = torch.from_numpy(camera.c2w[:3, :3].T.copy()).float()
    normals = torch.einsum("ij,jhw->ihw", rotation, chw(np.nan_to_num(normal)))
    length = normals.norm(dim=0, keepdim=True)
    normals = normals / length.clamp_min(1e-6) * (length > 0.1)
    pinhole = pinhole_of(camera)
    return Surfaces(pinhole_rays(pinhole, *depth.shape) * depth, normals, pinhole)


GLOWING = 0.5
"""Of a burning lamp's mask, what is brighter than this share of its brightest tenth glows."""


def lamp_centres(
    masks: Float[Tensor, "k h w"],
    surfaces: Surfaces,
    photo: Float[Tensor, "3 h w"],
    on: Bool[Tensor, " k"],
) -> tuple[Float[Tensor, "k 3"], Bool[Tensor, " k"]]:
    """Camera-space centre of what each mask covers, metres, and whether any of it has depth.

    Of a burning lamp only what glows counts: a floor lamp shines from its top, not from its pole.
    """
    weight = masks * (surfaces.points[2] > 0)
    brightness = photo.amax(0)
    for index in torch.nonzero(on)[:, 0].tolist():
        inside = weight[index] > 0.3
        if bool(inside.any()):
            peak = torch.quantile(brightness[inside], 0.9)
            weight[index] *= brightness >= GLOWING * peak
    total = weight.sum((1, 2))
    centres = torch.einsum("khw,chw->kc", weight, surfaces.points) / total.clamp_min(1e-6)[:, None]
    return centres, total > 0


def lambert_terms(
    surfaces: Surfaces, centre: Float[Tensor, " 3"]
) -> tuple[Float[Tensor, "3 h w"], Float[Tensor, "h w"], Float[Tensor, "h w"]]:
    """Unit direction to the lamp, distance in metres, and cos/d² for a lamp at `centre`."""
    offset = centre.view(3, 1, 1) - surfaces.points
    distance = offset.norm(dim=0).clamp_min(0.05)
    direction = offset / distance
    cosine = (direction * surfaces.normals).sum(0).clamp_min(0)
    return direction, distance, cosine / distance**2
