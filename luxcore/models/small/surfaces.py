"""Depth and normals of a photo in camera space, and how a lamp stands to them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from luxcore.cameras import Camera
from luxcore.models.small.samples import chw


@dataclass(frozen=True)
class Surfaces:
    """Geometry of one photo on the network's grid; zeros where unknown.

    `points` are camera-space positions in metres, `normals` unit vectors in camera axes. `trust`
    is 1 for given geometry and less for what was estimated from the photo.
    """

    points: Float[Tensor, "3 h w"]
    normals: Float[Tensor, "3 h w"]
    trust: float = 1.0

    @property
    def valid(self) -> Bool[Tensor, "h w"]:
        """Where the surface is known."""
        return (self.points[2] > 0) & (self.normals.abs().sum(0) > 0)


def pixel_rays(camera: Camera) -> Float[Tensor, "3 h w"]:
    """Camera-space directions of the pixel centres with z = 1."""
    x = (torch.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    y = (torch.arange(camera.height) + 0.5 - camera.cy) / camera.fy
    grid_y, grid_x = torch.meshgrid(y, x, indexing="ij")
    return torch.stack([grid_x, grid_y, torch.ones_like(grid_x)]).float()


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
    return Surfaces(pixel_rays(camera) * depth, normals / length.clamp_min(1e-6) * (length > 0.1))


def lamp_centres(
    masks: Float[Tensor, "k h w"], surfaces: Surfaces
) -> tuple[Float[Tensor, "k 3"], Bool[Tensor, " k"]]:
    """Camera-space centre of what each mask covers, metres, and whether any of it has depth."""
    weight = masks * (surfaces.points[2] > 0)
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
