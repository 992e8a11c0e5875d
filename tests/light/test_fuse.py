"""The fuse stage on a capture whose light is known."""

import json
from pathlib import Path

import numpy as np
import pytest

from luxcore.cameras import look_at
from luxcore.capture import Capture
from luxcore.capture.points import Points
from luxcore.capture.store import View, write_capture
from luxcore.errors import InputError, LuxError
from luxcore.files.exr import read_exr, write_exr
from luxcore.files.photos import write_png
from luxcore.light.agx import agx
from luxcore.light.fuse import fuse_capture
from luxcore.settings.fuse import FuseSettings
from luxcore.units import UnitStore

G = 0.5
SIZE = (12, 16)


def light(seed: int, level: float) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return (level * rng.uniform(0.5, 1.0, (*SIZE, 3))).astype(np.float32)


@pytest.fixture
def capture(tmp_path: Path) -> Capture:
    cameras = [
        look_at(np.array([x, 0.0, 1.0]), np.array([0.0, 3.0, 1.0]), 60.0, SIZE[1], SIZE[0])
        for x in (0.0, 1.0)
    ]
    photo = agx(G * light(0, 1.0))
    points = Points(np.zeros((1, 3), np.float32), np.zeros((1, 3), np.uint8))
    views = [View(f"{i}.png", photo, camera) for i, camera in enumerate(cameras)]
    return write_capture(
        tmp_path / "capture", "tiny", views, points, source="test", metric=True, exposure=G
    )


MERGED = FuseSettings(method="debevec")


@pytest.fixture
def harmonize_dir(tmp_path: Path) -> Path:
    root = tmp_path / "harmonize"
    for view in range(2):
        layers = {"ambient": light(view, 0.3), "light_00": light(view + 5, 90.0)}
        write_exr(root / "direct" / f"{view:04d}.exr", layers, half=False)
        for name, pixels in layers.items():
            for stops in (0, 2, 4):
                shown = agx(pixels * np.float32(G * 2.0**-stops))
                file = f"{view:04d}_{name.removeprefix('light_')}_ev{stops}.png"
                write_png(root / "brackets" / file, shown)
    return root


def test_light_beyond_one_exposure_is_recovered(tmp_path, capture, harmonize_dir):
    store = UnitStore(tmp_path / "units")
    metrics = fuse_capture(harmonize_dir, capture, tmp_path / "out", MERGED, store)
    layers = read_exr(tmp_path / "out" / "0001.exr")
    assert sorted(layers) == ["ambient", "light_00"]
    # EV 0 alone is white here: AgX ends at 16.3 and g·I reaches 45.
    assert np.median(np.abs(layers["light_00"] / light(6, 90.0) - 1)) < 0.02
    assert metrics["clipped_share"] == 0
    assert 0 < metrics["median_difference_to_direct"] < 0.02
    about = json.loads((tmp_path / "out" / "fuse.json").read_text())
    assert about["method"] == "debevec"
    assert about["exposure"] == G


def test_direct_takes_the_models_light_and_merges_some_views(tmp_path, capture, harmonize_dir):
    # The second view is not to be merged: its exposures are not missed.
    for file in (harmonize_dir / "brackets").glob("0001_*"):
        file.unlink()
    metrics = fuse_capture(
        harmonize_dir, capture, tmp_path / "out", FuseSettings(), UnitStore(tmp_path / "units")
    )
    for view in (0, 1):
        layers = read_exr(tmp_path / "out" / f"{view:04d}.exr")
        assert np.array_equal(layers["light_00"], light(view + 5, 90.0))
    assert 0 < metrics["median_difference_to_direct"] < 0.02
    assert json.loads((tmp_path / "out" / "fuse.json").read_text())["method"] == "direct"


def test_finished_views_are_not_fused_again(tmp_path, capture, harmonize_dir):
    store = UnitStore(tmp_path / "units")
    fuse_capture(harmonize_dir, capture, tmp_path / "a", MERGED, store)
    stamps = {p: p.stat().st_mtime_ns for p in store.root.rglob("fused.exr")}
    fuse_capture(harmonize_dir, capture, tmp_path / "b", MERGED, store)
    assert stamps == {p: p.stat().st_mtime_ns for p in store.root.rglob("fused.exr")}
    assert (tmp_path / "a/0000.exr").read_bytes() == (tmp_path / "b/0000.exr").read_bytes()


def test_missing_files_are_named(tmp_path, capture, harmonize_dir):
    store = UnitStore(tmp_path / "units")
    for file in (harmonize_dir / "brackets").glob("0001_00_*"):
        file.unlink()
    with pytest.raises(LuxError, match="no exposures of light_00 in view 1"):
        fuse_capture(harmonize_dir, capture, tmp_path / "out", MERGED, store)
    assert not (tmp_path / "out" / "fuse.json").exists()
    (harmonize_dir / "direct" / "0000.exr").unlink()
    with pytest.raises(InputError, match=r"0000\.exr does not exist"):
        fuse_capture(harmonize_dir, capture, tmp_path / "out", MERGED, store)
