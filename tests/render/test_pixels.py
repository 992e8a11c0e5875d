"""Energy through the denoiser, noise, views as JSON, exposure, the renderer's own process."""

from __future__ import annotations

import json
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from luxcore.cameras import look_at
from luxcore.errors import FormatError, InputError, LuxError
from luxcore.files.exr import write_exr
from luxcore.render.compact import KEY_LUMINANCE, photo_exposure
from luxcore.render.hdri import blender_hdri_folder, hdri_path, mean_luminance
from luxcore.render.masks import dilated
from luxcore.render.noise import joined, relative_noise
from luxcore.render.oidn import Denoiser, keep_energy
from luxcore.render.process import BlenderProcess
from luxcore.render.views import PanoramaView, view_from_json, view_to_json
from luxcore.rooms.generate import environment_names
from luxcore.settings.rooms import RoomsSettings


def test_energy_is_kept_outside_of_emitters() -> None:
    rng = np.random.Generator(np.random.PCG64(0))
    noisy = rng.exponential(0.2, (32, 32, 3)).astype(np.float32)
    emitter = np.zeros((32, 32), bool)
    emitter[:4, :4] = True
    noisy[emitter] = 100.0
    dark = np.where(emitter[..., None], noisy, noisy * 0 + 0.15).astype(np.float32)
    kept, factor = keep_energy(noisy, dark, emitter, emitter)
    assert kept[~emitter].mean() == pytest.approx(noisy[~emitter].mean(), rel=1e-5)
    assert (kept[emitter] == 100.0).all()
    assert factor > 1.2


def test_energy_factor_is_bounded_and_black_stays_black() -> None:
    black = np.zeros((8, 8, 3), np.float32)
    nowhere = np.zeros((8, 8), bool)
    kept, factor = keep_energy(black, black, nowhere, nowhere)
    assert factor == 1.0
    assert not kept.any()
    firefly = black.copy()
    firefly[0, 0] = 1e4
    assert keep_energy(firefly, black + np.float32(0.1), nowhere, nowhere)[1] == 2.0


def test_the_spread_rim_of_a_bulb_does_not_rule_the_energy() -> None:
    rng = np.random.Generator(np.random.PCG64(2))
    noisy = rng.exponential(0.2, (64, 64, 3)).astype(np.float32)
    bulb = np.zeros((64, 64), bool)
    bulb[30:32, 30:32] = True
    noisy[29:33, 29:33] = 5e3
    denoised = np.full_like(noisy, 0.2)
    denoised[28:34, 28:34] = 3e3
    rim = dilated(dilated(bulb, wraps=False), wraps=False)
    assert keep_energy(noisy, denoised, bulb, rim)[1] == pytest.approx(1.0, abs=0.02)
    assert keep_energy(noisy, denoised, bulb, bulb)[1] < 0.7


def test_denoiser_removes_noise_and_has_the_same_bits_on_two_threads() -> None:
    rng = np.random.Generator(np.random.PCG64(1))
    truth = np.zeros((64, 96, 3), np.float32)
    truth[:, 48:] = 0.5
    truth += 0.2
    normal = np.zeros_like(truth)
    normal[..., 2] = 1
    noisy = (truth * rng.gamma(2.0, 0.5, truth.shape)).astype(np.float32)
    results = []
    for threads in (1, 2):
        denoiser = Denoiser(truth, normal, quality="balanced", threads=threads)
        results.append(denoiser(noisy))
        denoiser.close()
    assert (results[0] == results[1]).all()
    assert np.abs(results[0] - truth).mean() < 0.25 * np.abs(noisy - truth).mean()


def test_noise_of_gaussian_residuals() -> None:
    rng = np.random.Generator(np.random.PCG64(2))
    clean = np.full((64, 64, 3), 2.0, np.float32)
    noisy = (clean + rng.normal(0, 0.5, clean.shape)).astype(np.float32)
    nowhere = np.zeros((64, 64), bool)
    # The mean absolute value of a normal variable is sigma · sqrt(2 / pi).
    expected = 0.5 * np.sqrt(2 / np.pi) / 2.0
    assert relative_noise(noisy, clean, nowhere) == pytest.approx(expected, rel=0.03)
    assert relative_noise(noisy, clean, ~nowhere) == 0.0


def test_joined_renders_weigh_by_samples() -> None:
    one, two = np.full((2, 2, 3), 1.0, np.float32), np.full((2, 2, 3), 5.0, np.float32)
    assert joined(one, 8, two, 24) == pytest.approx(np.full((2, 2, 3), 4.0))


def test_views_survive_json() -> None:
    panorama = PanoramaView((1.0, 2.0, 1.5), 64, 32, 30.0)
    assert view_from_json(json.loads(json.dumps(view_to_json(panorama)))) == panorama
    pinhole = look_at(np.array([0.0, 0, 1.5]), np.array([1.0, 1, 1]), 70.0, 64, 48)
    back = view_from_json(json.loads(json.dumps(view_to_json(pinhole))))
    assert back.c2w == pytest.approx(pinhole.c2w)
    assert view_to_json(pinhole)["kind"] == "perspective"
    with pytest.raises(InputError, match="twice as wide"):
        PanoramaView((0.0, 0.0, 1.5), 64, 64)


def test_panorama_yaw_turns_its_centre() -> None:
    turned = PanoramaView((0.0, 0.0, 1.5), 64, 32, 90.0).c2w[:3, :3]
    assert turned @ [1, 0, 0] == pytest.approx([0, 1, 0], abs=1e-12)


def test_exposure_ignores_the_lamps() -> None:
    image = np.full((20, 20, 3), 0.02, np.float32)
    dull = photo_exposure(image)
    image[0, :10] = 500.0
    assert photo_exposure(image) == pytest.approx(dull)
    assert dull * 0.02 == pytest.approx(KEY_LUMINANCE, rel=1e-3)


def test_environments_of_blender() -> None:
    names = {p.stem for p in blender_hdri_folder().glob("*.exr")}
    assert {"city", "courtyard", "forest", "night", "sunrise", "sunset"} <= names
    assert mean_luminance(hdri_path("courtyard")) > 0
    with pytest.raises(InputError, match="no such environment"):
        hdri_path("/nowhere/sky.exr")


def test_environments_of_a_user(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Radiance and OpenEXR pictures; the mean is over the sphere, where poles weigh little."""
    sky = np.full((32, 64, 3), 1.0, np.float32)
    sky[:4] = 9.0
    write_exr(tmp_path / "sky.exr", {"image": sky}, half=False)
    cv2.imwrite(str(tmp_path / "sky.hdr"), sky)
    names = environment_names(RoomsSettings(hdri_folder=str(tmp_path)))
    assert [Path(n).name for n in names] == ["sky.exr", "sky.hdr"]
    # The share of the sphere above 67.5 degrees of elevation is (1 - sin 67.5°) / 2.
    expected = 1 + 8 * (1 - np.sin(np.radians(67.5))) / 2
    for name in names:
        assert mean_luminance(hdri_path(name)) == pytest.approx(expected, rel=0.01)
    (tmp_path / "broken.hdr").write_bytes(b"#?RADIANCE nothing")
    with pytest.raises(FormatError, match=r"broken\.hdr"):
        mean_luminance(tmp_path / "broken.hdr")
    assert capfd.readouterr().err == ""


@pytest.fixture
def stub() -> BlenderProcess:
    """A child that answers without Blender."""
    return BlenderProcess("tests.render.stub_server")


def test_a_stuck_renderer_is_killed_in_time(stub: BlenderProcess) -> None:
    start = time.monotonic()
    with pytest.raises(LuxError, match=r"no answer within 0\.5 s"):
        stub.request({"do": "sleep"}, 0.5)
    # Far below the 60 s that the stub would sleep; generous for a loaded machine.
    assert time.monotonic() - start < 30
    assert stub.request({"do": "work"}, 60.0) == {"pid": 1}
    stub.stop()


def test_a_dead_renderer_is_named_and_replaced(stub: BlenderProcess) -> None:
    with pytest.raises(LuxError, match=r"process ended.*out of memory"):
        stub.request({"do": "die"}, 60.0)
    with pytest.raises(LuxError, match="no such room"):
        stub.request({"do": "fail"}, 60.0)
    assert stub.request({"do": "work"}, 60.0) == {"pid": 1}
    stub.stop()
