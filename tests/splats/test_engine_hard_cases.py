"""Numerically hard cases of rasterization, each with the naive formula that it defeats."""

from __future__ import annotations

import numpy as np
import pytest
from engine_scenes import (
    NAMES,
    Scene,
    camera_at_origin,
    on_device,
    random_scene,
    relative,
    run_engine,
    run_twin,
)

from luxcore.cameras import Camera
from luxcore.errors import LuxError
from luxcore.splats.device import open_device
from luxcore.splats.rasterizer import RasterConfig, Rasterizer
from luxcore.splats.rasterizer.config import ALPHA_MAX, ALPHA_MIN

FORWARD = Camera(40.0, 40.0, 16.0, 16.0, 32, 32, np.eye(4))


def gaussian(n: int = 1, **arrays) -> Scene:
    """`n` equal, round, half opaque, white Gaussians of 10 cm, 2 m ahead of FORWARD."""
    base = Scene(
        np.tile([0.0, 0, 2], (n, 1)), np.tile([1.0, 0, 0, 0], (n, 1)),
        np.full((n, 3), np.log(0.1)), np.zeros(n), np.ones((n, 3)),
    )  # fmt: skip
    return base.replaced(**arrays)


def all_finite(gradients) -> bool:
    return all(np.isfinite(getattr(gradients, n).get()).all() for n in (*NAMES, "mean2d_norm"))


@pytest.mark.parametrize("z", [0.0, -2.0, 1e-30, 0.0099])
def test_nothing_divides_by_z_before_the_near_plane_culls(z):
    scene = gaussian(2, means=[[0.3, 0, z], [0, 0, 2]])
    out, gradients, _ = run_engine(open_device(), FORWARD, RasterConfig(), scene)
    alone, _, _ = run_engine(open_device(), FORWARD, RasterConfig(), gaussian())
    np.testing.assert_array_equal(out.image.get(), alone.image.get())
    assert out.radii.get()[0] == 0
    assert all_finite(gradients)
    assert not gradients.means.get()[0].any()


def test_too_many_intersections_are_counted_in_64_bits_and_refused():
    n, side = 40_000, 4096
    camera = Camera(4000.0, 4000.0, 2048.0, 2048.0, side, side, np.eye(4))
    scene = gaussian(n, log_scales=np.full((n, 3), 3.0))
    pairs = n * (side // 16) ** 2
    assert np.int64(pairs).astype(np.int32) < 0  # what a 32-bit counter would have said
    rasterizer = Rasterizer(open_device(), RasterConfig())
    with pytest.raises(LuxError, match=f"{pairs} intersections"):
        rasterizer.forward(camera, *on_device(open_device(), scene))


@pytest.mark.parametrize("name", ["means", "quats", "log_scales", "opacity_logits"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e38])
def test_garbage_hides_its_gaussian_and_no_other(name, value):
    clean = gaussian(3, colors=np.eye(3))
    dirty = getattr(clean, name).copy()
    dirty[1] = value
    drawn = name == "opacity_logits" and value > 0  # fully opaque is legal
    out, gradients, _ = run_engine(
        open_device(), FORWARD, RasterConfig(), clean.replaced(**{name: dirty})
    )
    assert np.isfinite(out.image.get()).all()
    assert all_finite(gradients)
    assert (out.radii.get()[1] > 0) == drawn
    assert out.image.get()[..., [0, 2]].max() > 0.1


def test_needle_keeps_its_determinant_and_its_gradients():
    """300 m by 1 mm, aslant: xx yy - xy^2 cancels in float32, a sum of squares does not."""
    angle = np.pi / 8
    scene = gaussian(
        quats=[[np.cos(angle), 0, 0, np.sin(angle)]], log_scales=np.log([[300.0, 1e-3, 1e-3]]),
        opacity_logits=[4.0],
    )  # fmt: skip
    row = np.float32(40 / 2 * 300 * np.sqrt(0.5))
    naive = (row * row + np.float32(0.3)) * (row * row + np.float32(0.3)) - (row * row) ** 2
    exact = 2 * 0.3 * float(row) ** 2 + 0.09
    assert abs(float(naive) / exact - 1) > 0.1
    out, gradients, upstream = run_engine(open_device(), FORWARD, RasterConfig(), scene)
    twin, expected = run_twin(FORWARD, RasterConfig(), scene, upstream)
    assert relative(out.image.get(), twin.image.detach().numpy()) < 1e-3
    for name in NAMES:
        assert relative(getattr(gradients, name).get(), expected[name]) < 1e-3, name


@pytest.mark.parametrize("antialiased", [False, True])
@pytest.mark.parametrize(("length", "width"), [(300, 1e-3), (30, 1e-3), (10, 0.03), (1, 0.01)])
def test_needle_gradients_do_not_cancel(length, width, antialiased):
    """conic · J W R S is the difference of numbers as much larger as the needle is long."""
    angle, config = np.pi / 8, RasterConfig(3, antialiased)
    scene = gaussian(
        quats=[[np.cos(angle), 0, 0.1, np.sin(angle)]],
        log_scales=np.log([[length, width, 0.7 * width]]), opacity_logits=[4.0],
        means=[[0.03, -0.02, 2]],
    )  # fmt: skip
    along = np.array([0.7, 0.72, 0.1]) * [40 / 2 * length, 40 / 2 * width, 40 / 2 * width]
    rows = np.array([along, along * [1, -0.97, 1.03]])

    def whitened(rows):
        (xx, xy), (_, yy) = rows @ rows.T + np.eye(2, dtype=rows.dtype) * rows.dtype.type(0.3)
        exact = np.linalg.det(rows.astype(float) @ rows.astype(float).T + 0.3 * np.eye(2))
        return np.array([[yy, -xy], [-xy, xx]]) @ rows / rows.dtype.type(exact)

    naive, exact = whitened(rows.astype(np.float32)), whitened(rows)
    assert length < 10 or abs(naive[0, 0] / exact[0, 0] - 1) > 1e-3  # what is allowed below
    _, gradients, upstream = run_engine(open_device(), FORWARD, config, scene)
    _, expected = run_twin(FORWARD, config, scene, upstream)
    for name in NAMES:
        assert relative(getattr(gradients, name).get(), expected[name]) < 1e-3, name


def test_zero_quaternion_is_dropped_and_length_does_not_matter():
    quats = np.random.default_rng(0).normal(size=(2, 4))
    scales = np.log([[0.3, 0.1, 0.05]] * 2)
    zero = gaussian(2, quats=[quats[0], np.zeros(4)], log_scales=scales)
    out, gradients, _ = run_engine(open_device(), FORWARD, RasterConfig(), zero)
    assert out.radii.get().tolist()[1] == 0
    assert all_finite(gradients)
    one = run_engine(open_device(), FORWARD, RasterConfig(), zero.replaced(quats=quats))
    three = run_engine(open_device(), FORWARD, RasterConfig(), zero.replaced(quats=3 * quats))
    np.testing.assert_allclose(one[0].image.get(), three[0].image.get(), atol=1e-6)
    d_one, d_three = one[1].quats.get(), three[1].quats.get()
    np.testing.assert_allclose(d_one, 3 * d_three, rtol=1e-3, atol=1e-5)
    # Through the normalisation: no gradient along the quaternion itself.
    along = np.abs((d_one * quats).sum(1))
    assert (along < 1e-4 * np.linalg.norm(d_one, axis=1)).all()


def test_flat_gaussian_seen_edge_on_is_finite():
    scene = gaussian(log_scales=[[np.log(0.2), -60, -60]], opacity_logits=[2.0])
    for antialiased in (False, True):
        out, gradients, _ = run_engine(open_device(), FORWARD, RasterConfig(3, antialiased), scene)
        assert np.isfinite(out.image.get()).all()
        assert all_finite(gradients)


def test_compensation_of_a_tiny_gaussian_has_a_floor():
    """A point of 1e-5 px would keep 1e-9 of its opacity and never come back."""
    scene = gaussian(
        means=[[0.025, 0.025, 2]], log_scales=np.full((1, 3), np.log(5e-7)), opacity_logits=[9.0]
    )
    naive = 1e-5**2 / 0.3
    assert naive < ALPHA_MIN  # hidden for good
    out, _, _ = run_engine(open_device(), FORWARD, RasterConfig(antialiased=True), scene)
    assert 0.8 * 0.005 < out.alpha.get().max() <= 0.005


@pytest.mark.parametrize(("logit", "drawn"), [(np.inf, True), (-np.inf, False), (-5.6, False)])
def test_extreme_opacities_neither_overflow_nor_take_the_log_of_nothing(logit, drawn):
    naive_log = np.log(255 / (1 + np.exp(5.6)))
    assert naive_log < 0  # its root, the radius, is NaN
    out, gradients, _ = run_engine(
        open_device(), FORWARD, RasterConfig(), gaussian(opacity_logits=[logit])
    )
    assert (out.radii.get()[0] > 0) == drawn
    assert all_finite(gradients)


def test_alpha_ceiling_is_the_same_forward_and_backward():
    """At the ceiling alpha is constant: neither opacity nor shape may get a gradient from there."""
    scene = gaussian(log_scales=np.full((1, 3), 6.0), opacity_logits=[30.0])
    out, gradients, _ = run_engine(open_device(), FORWARD, RasterConfig(), scene)
    np.testing.assert_allclose(out.alpha.get(), ALPHA_MAX, rtol=1e-6)
    for name in ("opacity_logits", "log_scales", "quats"):
        assert not getattr(gradients, name).get().any(), name
    assert gradients.colors.get().all()


def test_deep_stacks_do_not_divide_by_a_vanished_transmittance():
    n = 60
    z = np.linspace(1, 5, n)
    scene = gaussian(
        n, means=np.stack([z * 0, z * 0, z], 1), log_scales=np.zeros((n, 3)) - 1,
        opacity_logits=np.full(n, 3.0), colors=np.random.default_rng(0).uniform(size=(n, 3)),
    )  # fmt: skip
    transmittance = np.float32(1)
    for _ in range(n):  # what recovering T by division would start from
        transmittance *= np.float32(1 - 0.9526)
    assert transmittance < np.finfo(np.float32).tiny
    out, gradients, upstream = run_engine(open_device(), FORWARD, RasterConfig(), scene)
    _, expected = run_twin(FORWARD, RasterConfig(), scene, upstream)
    assert out.alpha.get().max() <= 1
    for name in NAMES:
        assert relative(getattr(gradients, name).get(), expected[name]) < 1e-3, name


def test_depth_ties_are_broken_by_index():
    n = 64
    colors = np.random.default_rng(0).uniform(size=(n, 3))
    out, _, upstream = run_engine(
        open_device(), FORWARD, RasterConfig(), gaussian(n, colors=colors)
    )
    twin, _ = run_twin(FORWARD, RasterConfig(), gaussian(n, colors=colors), upstream)
    reverse, _, _ = run_engine(
        open_device(), FORWARD, RasterConfig(), gaussian(n, colors=colors[::-1])
    )
    assert relative(out.image.get(), twin.image.detach().numpy()) < 1e-5
    assert relative(reverse.image.get(), out.image.get()) > 1e-3


@pytest.mark.parametrize(("width", "height"), [(1, 1), (1, 4096), (4096, 1), (17, 15), (33, 48)])
def test_sizes_that_are_no_multiple_of_the_tile(width, height):
    camera = camera_at_origin(width, height, focal=30.0)
    scene = random_scene(40, camera=camera, scale=0.2)
    for mapping in ("block", "pixel"):
        device = open_device(mapping=mapping)
        out, gradients, upstream = run_engine(device, camera, RasterConfig(), scene)
        if width * height < 5000 and mapping == "block":
            twin, expected = run_twin(camera, RasterConfig(), scene, upstream)
            assert relative(out.image.get(), twin.image.detach().numpy()) < 3e-5
            assert relative(gradients.means.get(), expected["means"]) < 1e-3
        assert out.image.shape == (height, width, 3)
        assert all_finite(gradients)


def test_no_gaussians_and_no_intersections_give_the_background():
    away = gaussian(means=[[0, 0, -5]])
    none = Scene(*(getattr(away, n)[:0] for n in NAMES))
    for scene in (away, none):
        out, gradients, _ = run_engine(open_device(), FORWARD, RasterConfig(), scene)
        assert not out.image.get().any()
        assert not out.alpha.get().any()
        assert out.intersections == 0
        assert gradients.means.shape == scene.means.shape
        assert not gradients.means.get().any()


def test_colours_are_never_clamped():
    """Negative and HDR radiance pass through, with a gradient."""
    out, gradients, _ = run_engine(
        open_device(), FORWARD, RasterConfig(), gaussian(colors=[[-3.0, 2e4, 0]])
    )
    image, alpha = out.image.get(), out.alpha.get()
    np.testing.assert_allclose(image[..., 0], -3 * alpha, rtol=1e-5)
    np.testing.assert_allclose(image[..., 1], 2e4 * alpha, rtol=1e-5)
    assert gradients.colors.get().all()


def test_wide_view_with_an_off_centre_principal_point_is_clamped_from_its_borders():
    """Far outside the image the Jacobian grows as (x/z)^2; a clamp about the centre is lopsided."""
    camera = Camera(20.0, 20.0, 58.0, 30.0, 64, 48, np.eye(4))
    scene = gaussian(2, means=[[-11, 0, 0.6], [0.2, 0, 0.6]], log_scales=np.full((2, 3), -1.5))
    naive = camera.fx / 0.6 * (11 / 0.6) * np.exp(-1.5) * 3.3
    out, gradients, upstream = run_engine(open_device(), camera, RasterConfig(), scene)
    twin, expected = run_twin(camera, RasterConfig(), scene, upstream)
    assert out.radii.get().max() < 0.2 * naive
    assert relative(out.image.get(), twin.image.detach().numpy()) < 3e-5
    assert relative(gradients.means.get(), expected["means"]) < 1e-3


def test_off_diagonal_of_the_conic_has_no_stray_factor():
    """For an aslant Gaussian the gradient of its mean runs along the conic, xy term included."""
    angle = np.pi / 8
    scene = gaussian(
        means=[[0.05, 0.02, 2]], quats=[[np.cos(angle), 0, 0, np.sin(angle)]],
        log_scales=np.log([[0.4, 0.05, 0.05]]),
    )  # fmt: skip
    _, gradients, upstream = run_engine(open_device(), FORWARD, RasterConfig(), scene)
    _, expected = run_twin(FORWARD, RasterConfig(), scene, upstream)
    for name in ("means", "quats", "log_scales"):
        np.testing.assert_allclose(
            getattr(gradients, name).get(), expected[name], rtol=1e-3, atol=1e-3
        )
