"""Torch twin of `raster_forward` (kernels/raster_block.cl, raster_pixel.cl)."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from luxcore.cameras import Camera
from luxcore.splats.rasterizer.config import (
    ALPHA_MAX,
    ALPHA_MIN,
    TILE,
    TRANSMITTANCE_MIN,
    RasterConfig,
)
from luxcore.splats.twin.projection import Projected, project_gaussians


@dataclass(frozen=True)
class TwinOutput:
    """One view on black; depth is the sum of weight times z."""

    image: Float[Tensor, "h w c"]
    alpha: Float[Tensor, "h w"]
    depth: Float[Tensor, "h w"]
    projected: Projected


def rasterize(
    camera: Camera,
    config: RasterConfig,
    means: Float[Tensor, "n 3"],
    quats: Float[Tensor, "n 4"],
    log_scales: Float[Tensor, "n 3"],
    opacity_logits: Float[Tensor, " n"],
    colors: Float[Tensor, "n c"],
) -> TwinOutput:
    """The view of `camera`: what `Rasterizer.forward` must give."""
    p = project_gaussians(camera, config, means, quats, log_scales, opacity_logits)
    features = torch.cat([colors, torch.ones_like(colors[:, :1]), p.depth[:, None]], 1)
    order = torch.argsort(p.depth.detach(), stable=True)
    order = order[p.visible[order]]  # [v], front to back, ties by index
    rows = []
    for y0 in range(0, camera.height, TILE):
        y1 = min(y0 + TILE, camera.height)
        row = [
            _blend_tile(p, order, features, (x0, y0, min(x0 + TILE, camera.width), y1))
            for x0 in range(0, camera.width, TILE)
        ]
        rows.append(torch.cat(row, 1))
    blended = torch.cat(rows, 0)  # [h, w, c + 2]
    return TwinOutput(blended[..., :-2], blended[..., -2], blended[..., -1], p)


def _blend_tile(
    p: Projected, order: Int[Tensor, " v"], features: Tensor, box: tuple[int, int, int, int]
) -> Float[Tensor, "th tw f"]:
    """Kerbl 2023, eq. 3 for the pixels x0 <= x < x1, y0 <= y < y1 of `box` = (x0, y0, x1, y1)."""
    x0, y0, x1, y1 = box
    dtype = features.dtype
    centre, extent = p.mean2d.detach()[order], p.extent[order]
    low = torch.tensor([x0, y0], dtype=dtype)
    high = torch.tensor([x1, y1], dtype=dtype)
    ids = order[((centre + extent > low) & (centre - extent < high)).all(1)]  # [m]
    ys, xs = torch.meshgrid(
        torch.arange(y0, y1, dtype=dtype) + 0.5,
        torch.arange(x0, x1, dtype=dtype) + 0.5,
        indexing="ij",
    )
    dx = p.mean2d[ids, 0] - xs.reshape(-1, 1)  # [pixels, m]
    dy = p.mean2d[ids, 1] - ys.reshape(-1, 1)
    a, b, c = p.conic[ids].unbind(1)
    power = 0.5 * (a * dx * dx + c * dy * dy) + b * dx * dy
    alpha = (p.opacity[ids] * torch.exp(-power)).clamp_max(ALPHA_MAX)
    alpha = torch.where(alpha >= ALPHA_MIN, alpha, 0.0)
    after = torch.cumprod(1 - alpha, 1)  # transmittance behind each Gaussian
    alpha = torch.where(after.detach() >= TRANSMITTANCE_MIN, alpha, 0.0)
    after = torch.cumprod(1 - alpha, 1)
    before = torch.cat([torch.ones_like(after[:, :1]), after[:, :-1]], 1)
    return ((alpha * before) @ features[ids]).reshape(y1 - y0, x1 - x0, -1)
