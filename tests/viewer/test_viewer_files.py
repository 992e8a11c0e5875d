"""Scenes that cannot be opened, cameras of browsers, exact pictures and films."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import imageio.v2 as imageio
import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation
from viewer_scene import room_scene, save_room

from luxcore.cameras import look_at
from luxcore.cli.view import command
from luxcore.errors import FormatError, InputError
from luxcore.files.digests import file_digest
from luxcore.files.photos import read_photo
from luxcore.light.agx import agx
from luxcore.splats.relighting import render_scene
from luxcore.viewer.cameras import camera_of_browser
from luxcore.viewer.exact import ExactRenderer, FilmStoppedError, Shot, write_film
from luxcore.viewer.lighting import original_lighting
from luxcore.viewer.open import open_scene
from luxcore.viewer.splat_node import covariances

CAMERA = look_at(np.array([0.0, -3.5, 1.3]), np.array([0.0, 0.5, 0.8]), 60.0, 49, 33)


def test_a_scene_opens_with_cameras_and_thumbnails(tmp_path: Path) -> None:
    viewed = open_scene(save_room(tmp_path / "room"))
    assert len(viewed.cameras) == 2
    assert list(viewed.thumbnails) == [0]


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (lambda room: (room / "scene.json").unlink(), "is not a scene"),
        (lambda room: (room / "lights.safetensors").unlink(), "lights.safetensors does not exist"),
        (lambda room: (room / "splats.ply").write_bytes(b"ply"), "splats.ply is damaged"),
        (lambda room: _set_version(room, 2), "version 2, this program reads 1"),
    ],
)
def test_a_bad_scene_is_one_sentence(tmp_path: Path, spoil, sentence: str) -> None:
    room = save_room(tmp_path / "room")
    spoil(room)
    result = CliRunner().invoke(command, [str(room), "--port", "1"])
    assert isinstance(result.exception, (InputError, FormatError))
    assert sentence in str(result.exception)
    assert "\n" not in str(result.exception)


@pytest.mark.parametrize("text", ["[]", "[" * 100_000, '{"frames": [{}]}'])
def test_bad_cameras_are_one_sentence(tmp_path: Path, text: str) -> None:
    room = save_room(tmp_path / "room")
    (room / "transforms.json").write_text(text)
    about = json.loads((room / "scene.json").read_text())
    about["digests"]["transforms.json"] = file_digest(room / "transforms.json")
    (room / "scene.json").write_text(json.dumps(about))
    with pytest.raises(FormatError, match=r"transforms\.json holds no usable cameras: .*[^.]\.$"):
        open_scene(room)


def _set_version(room: Path, version: int) -> None:
    about = json.loads((room / "scene.json").read_text())
    (room / "scene.json").write_text(json.dumps({**about, "version": version}))


def test_the_browsers_camera_is_ours() -> None:
    handle = SimpleNamespace(
        image_height=66,
        image_width=98,
        fov=2 * np.arctan(0.5 * CAMERA.height / CAMERA.fy),
        wxyz=np.roll(Rotation.from_matrix(CAMERA.c2w[:3, :3]).as_quat(), 1),
        position=CAMERA.centre,
    )
    camera = camera_of_browser(handle, 49 * 33)
    assert (camera.width, camera.height) == (49, 33)
    np.testing.assert_allclose(camera.c2w, CAMERA.c2w, atol=1e-12)
    assert camera.fy == pytest.approx(CAMERA.fy)


def test_covariances_have_the_scales_as_axes() -> None:
    random = np.random.Generator(np.random.PCG64(0))
    gaussians = room_scene(5).gaussians
    gaussians.quats[:] = random.standard_normal((5, 4))
    gaussians.log_scales[:] = random.uniform(-3, 0, (5, 3))
    spread = np.linalg.eigvalsh(covariances(gaussians).astype(np.float64))
    np.testing.assert_allclose(
        spread, np.sort(np.exp(2.0 * gaussians.log_scales), axis=1), rtol=1e-4
    )


def test_the_exact_picture_is_the_tone_mapped_render() -> None:
    scene = room_scene()
    picture = ExactRenderer(scene).display(Shot(CAMERA, original_lighting(scene)))
    np.testing.assert_allclose(picture, agx(render_scene(scene, CAMERA)), atol=1e-6)
    assert picture.max() > 0.3


def test_a_film_has_its_pictures_and_can_be_stopped(tmp_path: Path) -> None:
    scene = room_scene()
    renderer, lighting = ExactRenderer(scene), original_lighting(scene)
    shots = [Shot(CAMERA, lighting)] * 3
    told: list[int] = []
    film = write_film(tmp_path / "film", renderer, shots, 12, lambda: True, told.append)
    assert told == [0, 1, 2]
    assert sorted(p.name for p in film.parent.iterdir()) == [
        "0000.png", "0001.png", "0002.png", "film.mp4",
    ]  # fmt: skip
    frames = imageio.mimread(film)
    assert len(frames) == 3
    assert frames[0].shape == (32, 48, 3)
    # H.264 halves the resolution of colour and quantizes: same picture, not same pixels.
    still = read_photo(film.parent / "0000.png")[:32, :48]
    assert np.abs(frames[0] / 255.0 - still).mean() < 0.03
    with pytest.raises(FilmStoppedError):
        write_film(tmp_path / "stopped", renderer, shots, 12, lambda: False)
    assert not list((tmp_path / "stopped").glob("*.mp4"))
