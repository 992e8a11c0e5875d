"""Random hard Gaussians, cameras and sizes: no NaN, no crash, and laws that always hold."""

from __future__ import annotations

import numpy as np
from engine_scenes import NAMES, Scene, on_device
from hypothesis import given, settings
from hypothesis import strategies as st

from luxcore.cameras import Camera
from luxcore.splats.device import open_device
from luxcore.splats.rasterizer import RasterConfig, Rasterizer

HARD = [0.0, 1.0, -1.0, 1e-20, 1e20, -1e20, 5.0, 50.0, -50.0, 0.01, np.nan, np.inf, -np.inf]


@st.composite
def hard_cases(draw) -> tuple[Camera, Scene, bool]:
    """Ordinary random Gaussians in which a few numbers are replaced by hard ones."""
    width, height = draw(st.integers(1, 70)), draw(st.integers(1, 70))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n = draw(st.integers(0, 40))
    focal = draw(st.sampled_from([3.0, 40.0, 2000.0]))
    centre = draw(st.sampled_from([-0.5, 0.5, 1.5]))
    camera = Camera(focal, focal, width * centre, height * 0.5, width, height, np.eye(4))
    arrays = {
        "means": rng.normal((0, 0, 2), size=(n, 3)),
        "quats": rng.normal(size=(n, 4)),
        "log_scales": rng.normal(size=(n, 3)) * draw(st.sampled_from([0.5, 4.0])) - 2,
        "opacity_logits": rng.normal(size=n) * draw(st.sampled_from([1.0, 20.0])),
    }
    for _ in range(draw(st.integers(0, 4)) if n else 0):
        array = arrays[draw(st.sampled_from(sorted(arrays)))].reshape(-1)
        array[draw(st.integers(0, len(array) - 1))] = draw(st.sampled_from(HARD))
    return camera, Scene(**arrays, colors=rng.uniform(size=(n, 3))).replaced(), draw(st.booleans())


@given(hard_cases())
@settings(max_examples=120, deadline=None)
def test_anything_gives_finite_images_and_gradients(case):
    camera, scene, antialiased = case
    device = open_device()
    rasterizer = Rasterizer(device, RasterConfig(3, antialiased))
    out = rasterizer.forward(camera, *on_device(device, scene))
    image, alpha, depth = out.image.get(), out.alpha.get(), out.depth.get()
    assert np.isfinite(image).all()
    assert np.isfinite(depth).all()
    assert (alpha >= 0).all()
    assert (alpha <= 1 + 1e-5).all()
    # Colours lie in [0, 1], so the image lies under its alpha.
    assert (image <= alpha[..., None] * (1 + 1e-4) + 1e-6).all()
    ones = device.array(np.ones_like(image))
    gradients = rasterizer.backward(out, ones, d_depth=device.array(np.ones_like(depth)))
    hidden = out.radii.get() == 0
    for name in NAMES:
        values = getattr(gradients, name).get()
        assert np.isfinite(values).all(), name
        assert not values[hidden].any(), name


@given(st.integers(0, 2**32 - 1), st.floats(0.1, 4))
@settings(max_examples=25, deadline=None)
def test_blending_is_linear_in_the_colours(seed, factor):
    """image(a c1 + c2) = a image(c1) + image(c2): what relighting rests on."""
    rng, device = np.random.default_rng(seed), open_device()
    camera = Camera(40.0, 40.0, 20.0, 15.0, 40, 30, np.eye(4))
    geometry = [
        rng.normal((0, 0, 3), size=(50, 3)), rng.normal(size=(50, 4)),
        rng.normal(size=(50, 3)) * 0.5 - 2, rng.normal(size=50),
    ]  # fmt: skip
    arrays = [device.array(g.astype(np.float32)) for g in geometry]
    rasterizer = Rasterizer(device, RasterConfig())
    one, two = rng.uniform(size=(2, 50, 3)).astype(np.float32)

    def image(colors):
        return rasterizer.forward(camera, *arrays, device.array(colors)).image.get()

    mixed = image(np.float32(factor) * one + two)
    np.testing.assert_allclose(mixed, factor * image(one) + image(two), rtol=1e-4, atol=1e-5)
