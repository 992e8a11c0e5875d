"""Stage 2 end to end: lights from their images, frozen weights, a kill, and the scene it writes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from optim_room import (
    Room,
    make_room,
    write_light_inputs,
    write_room_capture,
)

from luxcore.capture import Capture
from luxcore.errors import FormatError, InputError
from luxcore.files.atomic import write_json
from luxcore.files.exr import read_exr, write_exr
from luxcore.light.agx import agx
from luxcore.masks.store import load_masks
from luxcore.settings.relight import RelightSettings
from luxcore.splats import light_fit, stage2
from luxcore.splats.baked import BakedView, padded
from luxcore.splats.device import open_device
from luxcore.splats.light_views import LightViews, light_units, read_exposure, toned_photo
from luxcore.splats.losses.constants import CLIPPED
from luxcore.splats.ply import read_ply, write_ply
from luxcore.splats.scene import load_scene
from luxcore.splats.stage2 import Stage2Result, fit_lights, open_light_fit
from luxcore.splats.starting_weights import starting_weights

SMALL = RelightSettings(
    joint_iterations=20,
    frozen_iterations=40,
    curve_every=30,
    smoothness_every=10,
    checkpoint_every=15,
)


def quiet(_: str) -> None:
    """No log."""


@pytest.fixture(scope="module")
def room() -> Room:
    return make_room(1200)


@pytest.fixture(scope="module")
def inputs(
    tmp_path_factory: pytest.TempPathFactory, room: Room
) -> tuple[Capture, Path, Path, Path]:
    """(capture, stage 1 with the true geometry, fuse, masks); lamp_1 was off in the photos."""
    folder = tmp_path_factory.mktemp("stage2")
    shone = Room(room.gaussians, room.albedo, room.lights[:, :2])
    capture = write_room_capture(folder / "box", shone)
    (folder / "splat").mkdir()
    write_ply(folder / "splat" / "splats.ply", room.gaussians)
    fuse, masks = write_light_inputs(folder, room, capture, on=(True, False))
    return capture, folder / "splat", fuse, masks


def fit(
    inputs: tuple[Capture, Path, Path, Path],
    out: Path,
    settings: RelightSettings = SMALL,
    checkpoint: Path | None = None,
) -> Stage2Result:
    return fit_lights(*inputs, out, settings, checkpoint=checkpoint, quiet=True, log=quiet)


def test_lights_are_found(
    inputs: tuple[Capture, Path, Path, Path], room: Room, tmp_path: Path
) -> None:
    result = fit(inputs, tmp_path)
    # True geometry and noise-free images: only the coverage of 9 small views limits the fit. Mean
    # colours alone, as the fit starts, reach about 27 dB.
    assert result.metrics["psnr_lights"] > 33
    scene = load_scene(tmp_path)
    assert scene.radiance.shape == (len(room.lights), 3, 3)
    assert [lamp.on for lamp in scene.lamps] == [True, False]
    assert scene.lamps[1].scale == (1.0, 1.0, 1.0)
    # The photos are lamp_0 and ambient at full: their scale factors are about one.
    np.testing.assert_allclose([scene.ambient_scale, scene.lamps[0].scale], 1.0, atol=0.05)
    assert (scene.radiance >= 0).all()
    assert (tmp_path / "thumbnails" / "lamp_1.png").is_file()
    points = json.loads((tmp_path / "curve.json").read_text())
    assert [point["iteration"] for point in points] == [30, 60]


def test_frozen_phase_moves_no_geometry(
    inputs: tuple[Capture, Path, Path, Path], tmp_path: Path
) -> None:
    fit(inputs, tmp_path, SMALL.model_copy(update={"joint_iterations": 0}))
    before, after = read_ply(inputs[1] / "splats.ply"), read_ply(tmp_path / "splats.ply")
    for name in ("means", "quats", "log_scales", "opacity_logits"):
        np.testing.assert_array_equal(getattr(before, name), getattr(after, name))


def test_cached_weights_change_nothing(
    inputs: tuple[Capture, Path, Path, Path], tmp_path: Path
) -> None:
    for name, megabytes in (("baked", 100), ("rasterized", 0)):
        fit(inputs, tmp_path / name, SMALL.model_copy(update={"max_baked_mb": megabytes}))
    baked, rasterized = (load_scene(tmp_path / n).radiance for n in ("baked", "rasterized"))
    # Gradients are summed in another order; Adam's first steps amplify that near zero.
    difference = np.linalg.norm(baked - rasterized) / np.linalg.norm(rasterized)
    assert difference < 2e-3


def test_cached_weights_stay_below_their_cap(
    inputs: tuple[Capture, Path, Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first views that fit, whatever order the steps take them in; one more would not."""
    made: list[BakedView | None] = []
    bake_within = light_fit.bake_within

    def recorded(*arguments: Any) -> BakedView | None:
        made.append(bake_within(*arguments))
        return made[-1]

    monkeypatch.setattr(light_fit, "bake_within", recorded)
    fit(inputs, tmp_path, SMALL.model_copy(update={"max_baked_mb": 3, "joint_iterations": 0}))
    cached = [view.nbytes for view in made if view is not None]
    assert 2 <= len(cached) < 8
    assert sum(cached) <= 3 * 2**20
    assert made[-1] is None
    assert len(made) == len(cached) + 1


def test_smoothness_reaches_what_the_view_of_its_step_does_not_see(
    inputs: tuple[Capture, Path, Path, Path],
) -> None:
    """One step with smoothness on one view: every Gaussian moves, as neighbours differ."""
    capture, splat, fuse, masks = inputs
    update = {"joint_iterations": 0, "smoothness_every": 1, "max_baked_mb": 100}
    settings = SMALL.model_copy(update=update)
    lamps = load_masks(masks).lamps
    stepped = open_light_fit(capture, splat, fuse, lamps, settings, seed=0)
    random = np.random.default_rng(0)
    shape = (stepped.model.count, stepped.views.channels)
    before = random.uniform(0.2, 0.8, shape).astype(np.float32)
    stepped.lights = padded(stepped.device, before)
    stepped.step()
    moved = (stepped.lights.get() != before).any(axis=1)
    assert moved.all()


class KilledError(Exception):
    """Stands for a kill."""


@pytest.mark.parametrize(("at", "megabytes"), [(18, 4096), (50, 4096), (50, 3)])
def test_killed_fit_resumes_to_the_same_bits(
    inputs: tuple[Capture, Path, Path, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    at: int,
    megabytes: int,
) -> None:
    settings = SMALL.model_copy(update={"max_baked_mb": megabytes})
    fit(inputs, tmp_path / "whole", settings)
    step = stage2.LightFit.step

    def dying_step(self: stage2.LightFit) -> None:
        if self.done == at:
            raise KilledError
        step(self)

    with monkeypatch.context() as patch:
        patch.setattr(stage2.LightFit, "step", dying_step)
        with pytest.raises(KilledError):
            fit(inputs, tmp_path / "resumed", settings, tmp_path / "checkpoint")
    assert not (tmp_path / "resumed" / "scene.json").exists()
    fit(inputs, tmp_path / "resumed", settings, tmp_path / "checkpoint")
    for name in ("splats.ply", "lights.safetensors", "scene.json", "curve.json", "metrics.json"):
        whole, resumed = (tmp_path / n / name for n in ("whole", "resumed"))
        assert whole.read_bytes() == resumed.read_bytes(), name


def test_one_bright_lamp_does_not_drown_the_rest() -> None:
    """In plain L1 a lamp of 10^4 has all the weight; in its own unit every light is about 1/2."""
    random = np.random.default_rng(0)
    image = random.random((20, 20, 9)).astype(np.float32)
    image[..., 3:6] *= 1e4
    image[..., 6:] = 0
    units = light_units([image, image])
    scaled = image / np.repeat(units, 3)
    assert scaled[..., :3].mean() == pytest.approx(0.5, rel=0.02)
    assert scaled[..., 3:6].mean() == pytest.approx(0.5, rel=0.02)
    # A light that adds nothing: 0 / 0 would be NaN.
    assert units[2] == 1
    # The lamp itself, a thousand times brighter than the room, does not set the unit.
    image[:2, 0, :3] = 1000
    assert light_units([image])[0] == pytest.approx(units[0], rel=0.1)


def test_missing_layers_sizes_and_exposures_are_named(
    inputs: tuple[Capture, Path, Path, Path], tmp_path: Path
) -> None:
    capture, splat, fuse, masks = inputs
    lamps = json.loads((masks / "lamps.json").read_text())
    third = {**lamps[1], "index": 2, "name": "lamp_2"}
    write_json(tmp_path / "masks" / "lamps.json", [*lamps, third])
    with pytest.raises(FormatError, match=r"0000.exr lacks the layer light_02"):
        fit((capture, splat, fuse, tmp_path / "masks"), tmp_path / "out")
    with pytest.raises(InputError, match="does not exist"):
        fit((capture, splat, tmp_path / "none", masks), tmp_path / "out")
    write_json(tmp_path / "fuse" / "fuse.json", {"exposure": -1.0})
    with pytest.raises(FormatError, match="exposure must be positive"):
        read_exposure(tmp_path / "fuse", capture)
    assert not (tmp_path / "out").exists()


def test_scale_factors_are_reached_from_any_unit(
    inputs: tuple[Capture, Path, Path, Path], tmp_path: Path
) -> None:
    """Light images of a lamp at 1/30 of its power: a fit by small steps from 1 stays near 1."""
    capture, splat, fuse, masks = inputs
    for index in range(len(capture.frames)):
        layers = read_exr(fuse / f"{index:04d}.exr")
        layers["light_00"] = layers["light_00"] / 30
        write_exr(tmp_path / "fuse" / f"{index:04d}.exr", layers, half=False)
    write_json(tmp_path / "fuse" / "fuse.json", {"exposure": 1.0})
    fit((capture, splat, tmp_path / "fuse", masks), tmp_path / "scene")
    np.testing.assert_allclose(load_scene(tmp_path / "scene").lamps[0].scale, 30, rtol=0.05)


def test_starting_weights_see_every_column() -> None:
    """21 views of 320x240: every 40th pixel would be 8 of the 320 columns, none of them lit."""
    device, size = open_device(), (240, 320)
    ambient, lamp = np.full((*size, 3), 0.2, np.float32), np.zeros((*size, 3), np.float32)
    lamp[:, 20::40] = 0.1
    photo = device.array(agx(ambient + 3 * lamp).astype(np.float32))
    target = device.array(np.concatenate([ambient, lamp], axis=2))
    views = LightViews((), (target,) * 21, (photo,) * 21, (), np.ones(2, np.float32))
    weights, again = (starting_weights(views, range(21), [True], 1.0) for _ in range(2))
    np.testing.assert_allclose(weights[1], 3, rtol=0.01)
    np.testing.assert_array_equal(weights, again)


def test_toned_photo_keeps_what_is_clipped() -> None:
    grey = np.linspace(0, 1, 101, dtype=np.float32)[:, None, None].repeat(3, 2)
    toned = toned_photo(grey)[:, 0, 0]
    assert (np.diff(toned) >= 0).all()
    np.testing.assert_array_equal(toned >= CLIPPED, grey[:, 0, 0] >= 0.98)
    # Back through AgX's inverse, T starts at (0.18 + β)^(1/γ); half an 8-bit step is 0.5 %.
    shown = agx(np.full((1, 1, 3), 0.18, np.float32)).astype(np.float32)
    assert toned_photo(shown)[0, 0, 0] == pytest.approx(0.182 ** (1 / 2.2), rel=5e-3)
