"""Spherical harmonics: against the twin, and against what a basis on the sphere must satisfy."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from engine_scenes import relative

from luxcore.splats.device import open_device
from luxcore.splats.harmonics import sh_backward, sh_forward
from luxcore.splats.twin import harmonics_forward
from luxcore.splats.twin.harmonics import basis


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize("clamp", [False, True])
def test_colour_and_gradients_match_the_twin(degree, clamp):
    rng, device, n = np.random.default_rng(degree), open_device(), 100
    means, sh = rng.normal(size=(n, 3)), rng.normal(size=(n, 16, 3))
    centre, upstream = np.array([0.3, -0.1, 2.0]), rng.normal(size=(n, 3))
    means, sh, upstream = (a.astype(np.float32) for a in (means, sh, upstream))
    on_device = [device.array(a) for a in (means, sh)]
    rgb = sh_forward(device, *on_device, centre, degree, clamp)
    d_sh, d_means = sh_backward(
        device, *on_device, centre, rgb, device.array(upstream), degree, clamp
    )
    leaves = [torch.tensor(a, dtype=torch.float64, requires_grad=True) for a in (means, sh)]
    expected = harmonics_forward(*leaves, torch.tensor(centre), degree, clamp)
    assert relative(rgb.get(), expected.detach().numpy()) < 1e-6
    loss = (expected * torch.tensor(upstream, dtype=torch.float64)).sum()
    gradients = torch.autograd.grad(loss, leaves, allow_unused=True)
    assert relative(d_sh.get(), gradients[1].numpy()) < 1e-6
    if gradients[0] is None:
        assert not d_means.get().any()
    else:
        assert relative(d_means.get(), gradients[0].numpy()) < 1e-5


def test_basis_is_orthonormal_on_the_sphere():
    """Gauss-Legendre in z and uniform in azimuth integrate degree 6 exactly."""
    z, weight = np.polynomial.legendre.leggauss(8)
    phi = np.arange(16) / 16 * 2 * np.pi
    ring = np.sqrt(1 - z**2)[:, None]
    x, y = ring * np.cos(phi), ring * np.sin(phi)
    points = np.stack([x, y, np.broadcast_to(z[:, None], x.shape)], -1).reshape(-1, 3)
    values = basis(torch.tensor(points), 3).numpy()
    weights = np.repeat(weight, 16) * (2 * np.pi / 16)
    np.testing.assert_allclose((values.T * weights) @ values, np.eye(16), atol=1e-12)


def test_too_few_coefficients_are_refused():
    device = open_device()
    with pytest.raises(ValueError, match="degree 2"):
        sh_forward(device, device.zeros((1, 3)), device.zeros((1, 4, 3)), np.zeros(3), 2)
