"""Public references: a stored image of another implementation, and a real captured scene."""

from __future__ import annotations

import numpy as np
import pytest
from engine_scenes import NAMES, Scene, relative, run_engine, run_twin
from safetensors.numpy import load_file

from luxcore.cameras import Camera
from luxcore.splats.device import open_device
from luxcore.splats.harmonics import sh_forward
from luxcore.splats.rasterizer import RasterConfig, Rasterizer


def test_stored_image_of_a_public_reference_is_reproduced(shared_data):
    folder = shared_data / "splat-ref-tiny" / "crates" / "brush-bench-test" / "test_cases"
    case = load_file(folder / "tiny_case.safetensors")
    expected = case["out_img"]  # [h, w, 4], premultiplied on black
    height, width = expected.shape[:2]
    c2w = np.eye(4)
    c2w[:3, 3] = (0.123, 0.456, -8.0)
    camera = Camera(width / 2, width / 2, width / 2, height / 2, width, height, c2w)
    device = open_device()
    means, quats, scales, logits, sh = (
        device.array(case[k]) for k in ("means", "quats", "scales", "opacities", "coeffs")
    )
    colors = sh_forward(device, means, sh, camera.centre, degree=3)
    out = Rasterizer(device, RasterConfig()).forward(camera, means, quats, scales, logits, colors)
    np.testing.assert_allclose(out.image.get(), expected[..., :3], rtol=0.01, atol=1e-5)
    np.testing.assert_allclose(out.alpha.get(), expected[..., 3], rtol=0.01, atol=1e-5)


@pytest.fixture(scope="module")
def garden(shared_data) -> tuple[Camera, Scene]:
    """A real view and its points as Gaussians, every 40th point, small enough for the twin."""
    path = shared_data / "gsplat-garden" / "assets" / "test_garden.npz"
    stored = np.load(path)
    viewmat, intrinsics = stored["viewmats"][0].astype(float), stored["Ks"][0].astype(float)
    width, height = int(stored["width"]), int(stored["height"])
    fx, fy, cx, cy = intrinsics[[0, 1, 0, 1], [0, 1, 2, 2]]
    camera = Camera(fx, fy, cx, cy, width, height, np.linalg.inv(viewmat)).resized(96, 64)
    means = stored["means3d"][::40]
    rng = np.random.default_rng(0)
    n = len(means)
    scene = Scene(
        means,
        rng.normal(size=(n, 4)),
        np.log(rng.uniform(0.005, 0.03, (n, 3))),
        rng.normal(size=n),
        stored["colors"][::40] / 255.0,
    )
    return camera, scene.replaced()


def test_real_scene_matches_the_twin(garden):
    camera, scene = garden
    config = RasterConfig(3)
    out, gradients, upstream = run_engine(open_device(), camera, config, scene)
    twin, twin_gradients = run_twin(camera, config, scene, upstream)
    assert (out.radii.get() > 0).sum() > 1000
    assert relative(out.image.get(), twin.image.detach().numpy()) < 1e-4
    for name in NAMES:
        assert relative(getattr(gradients, name).get(), twin_gradients[name]) < 1e-3, name
