"""Spherical harmonics of 3DGS on the device: view-dependent colour, degree 0 to 3.

    rgb = sh_forward(device, means, coefficients, camera.centre, degree=3)
    d_coefficients, d_means = sh_backward(device, means, coefficients, camera.centre, rgb, d_rgb, 3)

`coefficients` are [n, K, 3] with K >= (degree + 1)^2; only `degree` is compiled in, higher stored
coefficients get zero gradient. rgb = sum_k b_k(direction) c_k + 0.5, then max(rgb, 0) unless
`clamp=False`; the direction goes from the camera centre to the mean.
"""

from __future__ import annotations

import numpy as np
import pyopencl.array as cla

from luxcore.splats.device import Device, Kernels


def sh_forward(
    device: Device,
    means: cla.Array,
    coefficients: cla.Array,
    centre: np.ndarray,
    degree: int,
    clamp: bool = True,
) -> cla.Array:
    """rgb [n, 3] of Gaussians at `means` [n, 3] seen from `centre` [3] in the world."""
    n = means.shape[0]
    rgb = device.empty((n, 3))
    kernels = _kernels(device, coefficients, degree, clamp)
    device.launch(
        kernels.harmonics_forward, n, n, _float4(centre), means, coefficients, rgb, group=64
    )
    return rgb


def sh_backward(
    device: Device,
    means: cla.Array,
    coefficients: cla.Array,
    centre: np.ndarray,
    rgb: cla.Array,
    d_rgb: cla.Array,
    degree: int,
    clamp: bool = True,
) -> tuple[cla.Array, cla.Array]:
    """(d_coefficients [n, K, 3], d_means [n, 3]) for the gradient `d_rgb` of `rgb`."""
    n = means.shape[0]
    d_coefficients, d_means = device.empty(coefficients.shape), device.empty((n, 3))
    kernels = _kernels(device, coefficients, degree, clamp)
    device.launch(
        kernels.harmonics_backward, n, n, _float4(centre), means, coefficients, rgb, d_rgb,
        d_coefficients, d_means, group=64,
    )  # fmt: skip
    return d_coefficients, d_means


def _kernels(device: Device, coefficients: cla.Array, degree: int, clamp: bool) -> Kernels:
    stored = coefficients.shape[1]
    if not 0 <= degree <= 3 or stored < (degree + 1) ** 2:
        raise ValueError(f"degree {degree} needs (degree+1)^2 coefficients, got {stored}.")
    return device.program("harmonics", {"DEGREE": degree, "K": stored, "CLAMP": clamp})


def _float4(centre: np.ndarray) -> np.ndarray:
    return np.array([*np.asarray(centre, np.float32), 0], np.float32)
