"""Depth and normals of a photo, brought into camera space on a grid of any size."""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from luxcore.cameras import Camera
from luxcore.models.small.features import Surfaces
from luxcore.models.small.samples import chw


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
