"""Torch twin of `project_gaussians` (kernels/projection.cl)."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from luxcore.cameras import Camera
from luxcore.splats.rasterizer.config import ALPHA_MIN, COMPENSATION_MIN, RasterConfig


@dataclass(frozen=True)
class Projected:
    """Gaussians on the screen, px. Rows that are not visible hold finite placeholders."""

    mean2d: Float[Tensor, "n 2"]
    conic: Float[Tensor, "n 3"]
    """Inverse of the 2D covariance: xx, xy, yy, px^-2."""
    opacity: Float[Tensor, " n"]
    depth: Float[Tensor, " n"]
    extent: Float[Tensor, "n 2"]
    """Half width and half height of the box outside which alpha < ALPHA_MIN, px."""
    visible: Bool[Tensor, " n"]


def project_gaussians(
    camera: Camera,
    config: RasterConfig,
    means: Float[Tensor, "n 3"],
    quats: Float[Tensor, "n 4"],
    log_scales: Float[Tensor, "n 3"],
    opacity_logits: Float[Tensor, " n"],
) -> Projected:
    """EWA projection (Zwicker 2002; Kerbl 2023, eq. 5) with low-pass `config.eps2d`."""
    view = torch.as_tensor(camera.viewmat, dtype=means.dtype)
    t = means @ view[:3, :3].T + view[:3, 3]  # [n, 3]
    seen = (t[:, 2] >= config.near) & (quats.norm(dim=1) > 1e-12)
    far_point = torch.tensor([0.0, 0.0, 1.0], dtype=means.dtype)
    t = torch.where(seen[:, None], t, far_point)
    identity = torch.tensor([1.0, 0.0, 0.0, 0.0], dtype=means.dtype)
    rotation = quat_to_matrix(torch.where(seen[:, None], quats, identity))  # [n, 3, 3]
    spread = jacobian(camera, t) @ view[:3, :3] @ rotation * log_scales.exp()[:, None, :]
    cov = spread @ spread.mT  # [n, 2, 2] = J W R S S R^T W^T J^T
    xx, xy, yy = cov[:, 0, 0] + config.eps2d, cov[:, 0, 1], cov[:, 1, 1] + config.eps2d
    det_sharp = torch.linalg.cross(spread[:, 0], spread[:, 1]).square().sum(1)
    det = det_sharp + config.eps2d * (cov[:, 0, 0] + cov[:, 1, 1]) + config.eps2d**2
    opacity = torch.sigmoid(opacity_logits)
    if config.antialiased:
        opacity = opacity * (det_sharp / det).clamp_min(COMPENSATION_MIN**2).sqrt()
    mean2d = t[:, :2] / t[:, 2:] * _pair(camera.fx, camera.fy, t) + _pair(camera.cx, camera.cy, t)
    reach = (2 * (opacity.detach() / ALPHA_MIN).clamp_min(1).log()).sqrt()
    extent = reach[:, None] * torch.stack([xx, yy], 1).detach().sqrt()
    visible = seen & (opacity >= ALPHA_MIN) & _on_screen(camera, mean2d.detach(), extent)
    conic = torch.stack([yy, -xy, xx], 1) / det[:, None]
    return Projected(mean2d, conic, opacity, t[:, 2], extent, visible)


def quat_to_matrix(quats: Float[Tensor, "n 4"]) -> Float[Tensor, "n 3 3"]:
    """Rotation of w-x-y-z quaternions of any non-zero length."""
    w, x, y, z = torch.nn.functional.normalize(quats, dim=1).unbind(1)
    rows = [
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    ]  # fmt: skip
    return torch.stack(rows, 1).reshape(-1, 3, 3)


def jacobian(camera: Camera, t: Float[Tensor, "n 3"]) -> Float[Tensor, "n 2 3"]:
    """Derivative of the pixel by the point in camera axes, clamped outside the image.

    x/z is clamped 15 % of the image's width beyond the true borders (not beyond a centred
    principal point), or the approximation explodes at wide angles.
    """
    x, y, z = t.unbind(1)
    margin_x, margin_y = 0.15 * camera.width / camera.fx, 0.15 * camera.height / camera.fy
    tx = z * (x / z).clamp(
        -camera.cx / camera.fx - margin_x, (camera.width - camera.cx) / camera.fx + margin_x
    )
    ty = z * (y / z).clamp(
        -camera.cy / camera.fy - margin_y, (camera.height - camera.cy) / camera.fy + margin_y
    )
    zero = torch.zeros_like(z)
    row0 = torch.stack([camera.fx / z, zero, -camera.fx * tx / z**2], 1)
    row1 = torch.stack([zero, camera.fy / z, -camera.fy * ty / z**2], 1)
    return torch.stack([row0, row1], 1)


def _pair(a: float | int, b: float | int, like: Tensor) -> Tensor:
    return torch.tensor([a, b], dtype=like.dtype)


def _on_screen(camera: Camera, mean2d: Tensor, extent: Tensor) -> Tensor:
    low, high = mean2d - extent, mean2d + extent
    size = _pair(camera.width, camera.height, mean2d)
    return ((high > 0) & (low < size)).all(1)
