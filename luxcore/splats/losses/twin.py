"""Torch twins of the loss kernels: the specification, and the oracle of their tests."""

from __future__ import annotations

import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.nn.functional import conv2d, softplus

from luxcore.splats.losses.constants import (
    BETA_MIN,
    CLIPPED,
    GAMMA_MAX,
    GAMMA_MIN,
    SSIM_C1,
    SSIM_C2,
    SSIM_WINDOW,
)


def image_loss(
    x: Float[Tensor, "h w c"], y: Float[Tensor, "h w c"], l1_weight: float, ssim_weight: float
) -> Float[Tensor, ""]:
    """l1_weight · mean |x - y| + ssim_weight · (1 - SSIM), twin of `loss_image.cl`."""
    return l1_weight * (x - y).abs().mean() + ssim_weight * (1 - ssim(x, y))


def ssim(x: Float[Tensor, "h w c"], y: Float[Tensor, "h w c"]) -> Float[Tensor, ""]:
    """Mean SSIM (Wang et al. 2004), zero outside the image, variances clamped at zero."""
    mx, my = _blur(x), _blur(y)
    # relu has derivative 0 where the variance is clamped, as the kernel.
    vx, vy = torch.relu(_blur(x * x) - mx * mx), torch.relu(_blur(y * y) - my * my)
    cxy = _blur(x * y) - mx * my
    # The kernel also clamps the covariance, which only rounding in float32 makes necessary.
    top = (2 * mx * my + SSIM_C1) * (2 * cxy + SSIM_C2)
    return (top / ((mx * mx + my * my + SSIM_C1) * (vx + vy + SSIM_C2))).mean()


def composition_loss(
    x: Float[Tensor, "h w m3"],
    photo: Float[Tensor, "h w 3"],
    params: Float[Tensor, " p"],
    unit: Float[Tensor, " m"],
) -> Float[Tensor, ""]:
    """mean |T(Σ_m w_m x_m unit_m) - photo|, twin of `loss_composition.cl`."""
    lights = len(unit)
    weights = params[: 3 * lights].reshape(lights, 3)
    beta = BETA_MIN + softplus(params[-2])
    gamma = GAMMA_MIN + (GAMMA_MAX - GAMMA_MIN) * torch.sigmoid(params[-1])
    radiance = x.reshape(*x.shape[:2], lights, 3) * unit[:, None]  # [h, w, m, 3]
    total = torch.relu((radiance * weights).sum(2))  # [h, w, 3]
    error = (total + beta) ** (1 / gamma) - photo
    ignored = (photo >= CLIPPED) & (error > 0)
    return torch.where(ignored, torch.zeros_like(error), error.abs()).mean()


def smoothness_loss(
    lights: Float[Tensor, "n c"], neighbors: Int[Tensor, "n k"]
) -> Float[Tensor, ""]:
    """1/(NK) Σ_i Σ_j |L_i - L_j|², twin of `loss_smoothness.cl`; a neighbour of -1 is absent."""
    present = neighbors >= 0
    difference = lights[:, None] - lights[neighbors.clamp(min=0)]  # [n, k, c]
    return (difference.square().sum(2) * present).sum() / max(int(present.sum()), 1)


def _blur(image: Float[Tensor, "h w c"]) -> Float[Tensor, "h w c"]:
    window = torch.tensor(SSIM_WINDOW, dtype=image.dtype)
    planes = image.permute(2, 0, 1)[:, None]  # [c, 1, h, w]
    reach = len(SSIM_WINDOW) // 2
    planes = conv2d(planes, window[None, None, :, None], padding=(reach, 0))
    planes = conv2d(planes, window[None, None, None, :], padding=(0, reach))
    return planes[:, 0].permute(1, 2, 0)
