"""A small tree of artifacts: one rendered capture with truth, and a set of two rooms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from luxcore.files.atomic import write_json
from luxcore.files.exr import write_exr
from luxcore.files.photos import write_png
from luxcore.light.agx import agx

H, W, VIEWS, LAMPS = 36, 48, 5, 2
EXPOSURE = 1.5
WRONG_VIEW = 3
"""The view whose second lamp the fixture gets badly wrong."""


def lights(view: int) -> dict[str, np.ndarray]:
    """Ambient and lamps of one view: pools of light that move with the view."""
    y, x = np.mgrid[0:H, 0:W] / W
    albedo = 0.3 + 0.2 * np.sin(12 * x + view)[..., None] * np.array([1, 0.7, 0.4])
    layers = {"ambient": 0.05 * albedo}
    for i in range(LAMPS):
        distance = (x - 0.3 - 0.4 * i - 0.03 * view) ** 2 + (y - 0.3) ** 2
        layers[f"light_{i:02d}"] = albedo * (0.04 / (distance + 0.03))[..., None]
    return {name: layer.astype(np.float32) for name, layer in layers.items()}


SCALE = [[1.0, 0.8, 0.6], [0.5, 0.6, 0.7]]
TRUTH_ORDER = {0: 1, 1: 0}
"""Lamp of the masks → lamp of the room."""


def photo(view: int) -> np.ndarray:
    layers = lights(view)
    mixed = layers["ambient"] + sum(
        layers[f"light_{i:02d}"] * np.float32(SCALE[i]) for i in range(LAMPS)
    )
    return agx(np.float32(EXPOSURE) * mixed)


@pytest.fixture(scope="session")
def artifacts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("artifacts")
    for view in range(VIEWS):
        _write_view(root, view)
    capture = root / "capture" / "demo"
    about = {"id": "demo", "metric": True, "exposure": EXPOSURE, "source": "rendered"}
    skipped = [{"name": "blurred.jpg", "reason": "no matches"}]
    write_json(capture / "capture.json", {**about, "views": VIEWS, "skipped": skipped})
    lamps = [
        {
            "index": i,
            "name": name,
            "on": True,
            "references": [0, 4],
            "areas": {"0": 9},
            "truth_light": TRUTH_ORDER[i],
        }
        for i, name in enumerate(["desk <b>lamp</b>", "ceiling"])
    ]
    write_json(root / "masks" / "demo" / "lamps.json", lamps)
    write_json(root / "fuse" / "demo" / "fuse.json", {"method": "debevec", "exposure": EXPOSURE})
    curve = [
        {"iteration": i, "seconds": i * 0.1, "psnr_heldout": 15 + i / 50} for i in (0, 50, 100)
    ]
    write_json(root / "relight" / "demo" / "metrics.json", {"psnr": 27.25, "gaussians": 1000})
    write_json(root / "evaluate" / "metrics.json", {"sv_psnr": 21.5})
    row = {
        "method": "copy",
        "cases": "lamp on",
        "count": 8,
        "scores": {"psnr": 14.25, "lpips": None},
    }
    table = {"title": "Single-view", "rows": [row], "paper": {"SD": [27.13]}, "notes": ["Ours."]}
    write_json(root / "evaluate" / "tables" / "sv.json", table)
    write_json(
        root / "train_sv" / "curve.json", [{"step": s, "loss": 1 / (s + 1)} for s in range(5)]
    )
    write_json(
        root / "timings" / "splat.json",
        {"wall_s": 12.5, "peak_memory_mb": 300.0, "curve_demo": curve},
    )
    lights_curve = [
        {"iteration": i, "seconds": i * 0.2, "psnr_lights": 18 + i / 40} for i in (0, 40, 80)
    ]
    write_json(root / "timings" / "relight.json", {"wall_s": 3.0, "curve_demo": lights_curve})
    for room in range(2):
        _write_room(root, room)
    _write_effects(root / "effects")
    return root


def _write_effects(folder: Path) -> None:
    row = {
        "effect": "portals",
        "decided": "on, 2",
        "reason": "one per opening",
        "seconds": 2.0,
        "seconds_other": 1.75,
        "light_other": -0.125,
        "difference": 3.5,
        "noise": 1.25,
    }
    write_json(folder / "effects.json", {"version": 1, "about": {}, "rooms": {"demo-demo": [row]}})
    write_png(folder / "picture.png", photo(0))
    Image.open(folder / "picture.png").convert("RGB").save(folder / "demo-demo.jpg")


def _write_view(root: Path, view: int) -> None:
    capture, fuse = root / "capture" / "demo", root / "fuse" / "demo"
    layers = lights(view)
    write_png(capture / "images" / f"{view:04d}.png", photo(view))
    truth = {"ambient": layers["ambient"]}
    # The truth is stored at unit white, in the room's own order of lamps.
    for i, j in TRUTH_ORDER.items():
        truth[f"light_{j:02d}"] = layers[f"light_{i:02d}"] / np.float32(SCALE[i])
    write_exr(capture / "truth" / f"{view:04d}.exr", truth)
    lamps = [{"scale": SCALE[i]} for j in range(LAMPS) for i in TRUTH_ORDER if TRUTH_ORDER[i] == j]
    write_json(capture / "truth" / "lights.json", {"lamps": lamps})
    mask = np.zeros((H, W), bool)
    mask[5:9, 10 + view : 16 + view] = True
    write_png(root / "masks" / "demo" / f"{view:04d}_00.png", mask)
    estimate = {name: layer * np.float32(1.1) for name, layer in layers.items()}
    if view == WRONG_VIEW:
        estimate["light_01"] = estimate["light_01"][:, ::-1].copy()
    write_exr(fuse / f"{view:04d}.exr", estimate, half=False)
    depth = np.linspace(1, 4, H * W, dtype=np.float32).reshape(H, W)
    write_exr(root / "splat" / "demo" / "depth" / f"{view:04d}.exr", {"depth_m": depth}, half=False)
    if view in (0, 4):
        folder = root / "decompose" / "demo" / f"{view:04d}"
        for name, layer in layers.items():
            write_exr(folder / f"{name}.exr", {name: layer})
        write_json(folder / "lights.json", {"scale": SCALE, "recomposition_db": 40.0})


def _write_room(root: Path, room: int) -> None:
    lamps = [
        {"id": i, "name": f"lamp {i}", "kind": "table", "power_w": 8.0, "on": i == 0, "scale": s}
        for i, s in enumerate(SCALE)
    ]
    effects = {"portals": {"on": room == 0, "reason": "one per opening", "amount": room}}
    folder = root / "render" / "train"
    write_exr(folder / f"{room:06d}.exr", {**lights(room), "albedo": lights(room)["ambient"]})
    metadata = {"room": room, "lamps": lamps, "effects": effects, "exposure": 1.0, "spp": 16}
    write_json(folder / f"{room:06d}.json", metadata)
