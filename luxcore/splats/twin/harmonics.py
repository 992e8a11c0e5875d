"""Torch twin of `harmonics_forward` (kernels/harmonics.cl)."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor


def harmonics_forward(
    means: Float[Tensor, "n 3"],
    coefficients: Float[Tensor, "n k 3"],
    centre: Float[Tensor, 3],
    degree: int,
    clamp: bool = True,
) -> Float[Tensor, "n 3"]:
    """rgb = sum_k b_k(dir) c_k + 0.5, dir from the camera `centre` to the mean (3DGS signs)."""
    direction = torch.nn.functional.normalize(means - centre, dim=1)
    values = basis(direction, degree)  # [n, (degree + 1)^2]
    rgb = torch.einsum("nk,nkc->nc", values, coefficients[:, : values.shape[1]]) + 0.5
    return rgb.clamp_min(0) if clamp else rgb


def basis(direction: Float[Tensor, "n 3"], degree: int) -> Float[Tensor, "n k"]:
    """Real spherical harmonics of unit vectors (Sloan 2013), Condon-Shortley signs of 3DGS."""
    x, y, z = direction.unbind(1)
    xx, yy, zz = x * x, y * y, z * z
    rows = [torch.full_like(x, 0.28209479177387814)]
    if degree > 0:
        rows += [k * v for k, v in zip(_BAND_1, (y, z, x), strict=True)]
    if degree > 1:
        band: tuple[Tensor, ...] = (x * y, y * z, 2 * zz - xx - yy, x * z, xx - yy)
        rows += [k * v for k, v in zip(_BAND_2, band, strict=True)]
    if degree > 2:
        band = (
            y * (3 * xx - yy), x * y * z, y * (4 * zz - xx - yy), z * (2 * zz - 3 * xx - 3 * yy),
            x * (4 * zz - xx - yy), z * (xx - yy), x * (xx - 3 * yy),
        )  # fmt: skip
        rows += [k * v for k, v in zip(_BAND_3, band, strict=True)]
    return torch.stack(rows, 1)


_BAND_1 = (-0.4886025119029199, 0.4886025119029199, -0.4886025119029199)
_BAND_2 = (
    1.0925484305920792, -1.0925484305920792, 0.31539156525252005, -1.0925484305920792,
    0.5462742152960396,
)  # fmt: skip
_BAND_3 = (
    -0.5900435899266435, 2.890611442640554, -0.4570457994644658, 0.3731763325901154,
    -0.4570457994644658, 1.445305721320277, -0.5900435899266435,
)  # fmt: skip
