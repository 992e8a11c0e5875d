"""Metrics: the rescale's hard cases, known values, and LPIPS against its published behaviour."""

import pickle

import numpy as np
import pytest
import torch

from luxcore.errors import FormatError
from luxcore.light.agx import agx
from luxcore.metrics import lpips as lpips_module
from luxcore.metrics.image import PSNR_CAP_DB, psnr, ssim
from luxcore.metrics.lpips import lpips, lpips_available, lpips_distance
from luxcore.metrics.rescale import channel_scale
from luxcore.metrics.score import log_rmse, score_pair

needs_lpips = pytest.mark.skipif(
    not lpips_available(), reason="LPIPS weights (requirements-nodeps.txt) are not installed"
)


def room(size: int = 64, seed: int = 0) -> np.ndarray:
    """A smooth bright-to-dark field with some texture, as a lamp makes."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:size, :size] / size
    light = 1.0 / (0.05 + (x - 0.3) ** 2 + (y - 0.4) ** 2)
    return (light[..., None] * rng.uniform(0.4, 0.6, (size, size, 3)) * 0.1).astype(np.float32)


def test_rescale_finds_the_colour_of_a_lamp():
    truth = room()
    assert np.allclose(channel_scale(truth / [2, 3, 4], truth), [2, 3, 4], rtol=1e-5)


def test_rescale_of_black_images_is_finite():
    black, image = np.zeros((8, 8, 3)), room(8)
    # 0/0 in the naive formula.
    assert np.allclose(channel_scale(black, image), 1)
    assert np.allclose(channel_scale(black, black), 1)
    assert np.allclose(channel_scale(image, black), 0)


def test_rescale_with_one_black_channel():
    truth, predicted = room(), room()
    predicted[..., 1] = 0
    scale = channel_scale(predicted, truth)
    assert np.allclose(scale, 1)


def test_rescale_is_never_negative_and_ignores_nan():
    truth, predicted = room(), -room()
    assert np.allclose(channel_scale(predicted, truth), 0)
    predicted = truth.copy()
    predicted[0, 0] = np.nan
    assert np.allclose(channel_scale(predicted, truth), 1)


def test_psnr_of_a_known_error():
    truth = np.full((4, 4, 3), 0.5)
    assert psnr(truth + 0.1, truth) == pytest.approx(20.0)
    assert psnr(truth, truth) == PSNR_CAP_DB


@pytest.mark.parametrize("size", [1, 2, 3, 6, 10, 11, 40])
def test_ssim_of_any_size(size):
    image = np.random.default_rng(0).uniform(size=(size, size, 3))
    assert ssim(image, image) == pytest.approx(1.0)
    assert ssim(1 - image, image) < 0.5


def test_score_pair_is_blind_to_the_lamps_colour_and_the_unscaled_score_is_not():
    truth = room()
    scores = score_pair(truth * np.float32([0.5, 1.0, 2.0]), truth, exposure=0.7)
    assert scores["psnr"] > 90
    assert scores["log_rmse"] < 1e-5
    assert scores["psnr_unscaled"] < 30
    shown = agx(truth * 0.7), agx(truth * np.float32([0.35, 0.7, 1.4]))
    assert scores["psnr_unscaled"] == pytest.approx(psnr(*shown), abs=1e-3)


def test_scores_of_a_broken_prediction_are_numbers():
    truth, predicted = room(), room()
    predicted[:4] = np.nan
    predicted[4:8] = np.inf
    scores = score_pair(predicted, truth, exposure=1.0)
    assert all(v is None or np.isfinite(v) for v in scores.values())
    assert scores["psnr"] < 40


def test_log_rmse_counts_stops():
    truth = np.full((2, 2, 3), 10.0)
    assert log_rmse(truth * 2, truth) == pytest.approx(1.0, abs=1e-3)


@needs_lpips
def test_lpips_orders_degradations_and_is_zero_for_equals():
    from skimage.data import astronaut
    from skimage.filters import gaussian

    image = astronaut()[::4, ::4].astype(np.float32) / 255
    slight = gaussian(image, 0.6, channel_axis=2)
    strong = gaussian(image, 3.0, channel_axis=2)
    assert lpips(image, image) == pytest.approx(0, abs=1e-6)
    assert 0.01 < lpips(slight, image) < lpips(strong, image)
    # A shift in brightness that PSNR punishes as much as the blur is nearly invisible to LPIPS.
    assert psnr(np.clip(image + 0.2, 0, 1), image) < psnr(strong, image)
    assert lpips(np.clip(image + 0.2, 0, 1), image) < 0.3 * lpips(strong, image)


@needs_lpips
def test_lpips_has_a_gradient_even_for_black():
    black = torch.zeros(1, 3, 40, 40, requires_grad=True)
    lpips_distance(black, torch.rand(1, 3, 40, 40)).sum().backward()
    assert torch.isfinite(black.grad).all()
    assert black.grad.abs().max() > 0


def test_lpips_is_none_where_it_cannot_be_had(monkeypatch):
    assert lpips(np.zeros((20, 20, 3), np.float32), np.zeros((20, 20, 3), np.float32)) is None
    monkeypatch.setattr(lpips_module, "_weights_path", lambda: None)
    assert lpips(room(), room()) is None


def test_a_weights_file_that_runs_code_is_refused(tmp_path):
    path = tmp_path / "alexnet.ckpt"
    path.write_bytes(pickle.dumps(print))
    with pytest.raises(FormatError, match="not an array"):
        lpips_module._read_arrays(path)
