"""Stage 1 end to end on a small synthetic room, and a kill in the middle of it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from optim_room import Room, make_room, write_room_capture

from luxcore.capture import Capture, Points, load_capture, write_points
from luxcore.files.exr import read_exr
from luxcore.settings.splat import SplatSettings
from luxcore.splats import stage1
from luxcore.splats.ply import read_ply
from luxcore.splats.stage1 import fit_geometry

SMALL = SplatSettings(
    iterations=120, initial_gaussians=500, max_gaussians=900, curve_every=40, checkpoint_every=30
)


@pytest.fixture(scope="module")
def room() -> Room:
    return make_room(1500)


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory, room: Room) -> Capture:
    return write_room_capture(tmp_path_factory.mktemp("room") / "box", room)


def quiet(_: str) -> None:
    """No log."""


def test_fit_rises_above_twenty_decibels(capture: Capture, tmp_path: Path) -> None:
    result = fit_geometry(capture, tmp_path, SMALL, quiet=True, log=quiet)
    qualities = [point.psnr_heldout for point in result.curve]
    # Points coloured by their photos start near 13 dB; a fit that only blurs stays below 17.
    assert qualities[-1] > 20
    assert qualities[-1] > qualities[0] + 3
    assert result.metrics["gaussians"] == len(read_ply(tmp_path / "splats.ply")) <= 900
    assert json.loads((tmp_path / "metrics.json").read_text()) == result.metrics
    # Equal runs have equal bytes: no seconds among the artifacts.
    curve = json.loads((tmp_path / "curve.json").read_text())
    assert [point["iteration"] for point in curve] == [40, 80, 120]
    assert all("seconds" not in point for point in curve)


def test_depth_and_normals_are_those_of_the_walls(capture: Capture, tmp_path: Path) -> None:
    fit_geometry(capture, tmp_path, SMALL, quiet=True, log=quiet)
    camera = capture.frames[0].camera
    layers = read_exr(tmp_path / "depth" / "0000.exr")
    depth_m, normal = layers["depth_m"][..., 0], layers["normal"]
    assert depth_m.shape == (camera.height, camera.width)
    # Walls are 1 to 4 m from a camera in the middle of a 4 x 3 x 2.4 m room.
    assert 0.9 < np.median(depth_m) < 4
    length = np.linalg.norm(normal, axis=2)
    assert np.abs(length[depth_m > 0] - 1).max() < 1e-3
    assert (np.abs(normal).max(axis=2) > 0.8).mean() > 0.5


class KilledError(Exception):
    """Stands for a kill."""


def test_killed_fit_resumes_to_the_same_bits(
    capture: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, resumed, checkpoint = (tmp_path / name for name in ("whole", "resumed", "checkpoint"))
    fit_geometry(capture, whole, SMALL, quiet=True, log=quiet)
    step = stage1.GeometryFit.step

    def dying_step(fit: stage1.GeometryFit) -> None:
        if fit.done == 70:
            raise KilledError
        step(fit)

    with monkeypatch.context() as patch:
        patch.setattr(stage1.GeometryFit, "step", dying_step)
        with pytest.raises(KilledError):
            fit_geometry(capture, resumed, SMALL, checkpoint=checkpoint, quiet=True, log=quiet)
    assert not (resumed / "splats.ply").exists()
    steps = []

    def counted_step(fit: stage1.GeometryFit) -> None:
        steps.append(fit.done)
        step(fit)

    monkeypatch.setattr(stage1.GeometryFit, "step", counted_step)
    fit_geometry(capture, resumed, SMALL, checkpoint=checkpoint, quiet=True, log=quiet)
    assert steps[0] == 60
    for name in ("splats.ply", "curve.json", "metrics.json"):
        assert (resumed / name).read_bytes() == (whole / name).read_bytes(), name
    assert not list(checkpoint.iterdir())


@pytest.mark.parametrize("density", ["standard", "mcmc"])
def test_same_seed_same_bits_other_seed_other_bits(
    capture: Capture, tmp_path: Path, density: str
) -> None:
    settings = SMALL.model_copy(update={"iterations": 30, "density": density})
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        fit_geometry(capture, tmp_path / name, settings, seed=seed, quiet=True, log=quiet)
    a, b, c = ((tmp_path / name / "splats.ply").read_bytes() for name in "abc")
    assert a == b
    assert a != c


def test_capture_without_points_and_with_too_few_views(capture: Capture, tmp_path: Path) -> None:
    """Nothing to start from and nothing to hold out is still a fit."""
    empty = Points(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint8))
    write_points(capture.root.parent / "points.ply", empty)
    few = Capture(capture.id, capture.root, capture.frames[:3], empty, True, None, "test", ())
    settings = SMALL.model_copy(update={"iterations": 10})
    metrics = fit_geometry(few, tmp_path, settings, quiet=True, log=quiet).metrics
    assert metrics["views_heldout"] == 0
    assert "psnr_heldout" not in metrics


def test_zero_iterations_write_the_start(capture: Capture, tmp_path: Path) -> None:
    settings = SMALL.model_copy(update={"iterations": 0})
    result = fit_geometry(load_capture(capture.root), tmp_path, settings, quiet=True, log=quiet)
    assert result.metrics["iterations"] == 0
    assert len(read_ply(tmp_path / "splats.ply")) == 500
