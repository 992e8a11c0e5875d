"""A sketched room as a capture with truth, masks and depth: what the stages read, in a second."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from luxcore.capture import Points, View, write_capture
from luxcore.data.crops import LitCrop
from luxcore.files.atomic import write_json
from luxcore.files.exr import write_exr
from luxcore.light.agx import agx
from luxcore.masks.store import FoundLamp, write_masks
from luxcore.models.small.network import LampNet, NetworkShape
from luxcore.models.small.sketch import SketchRooms
from luxcore.models.small.weights import CHANNELS, save_weights

TINY = (8, 16)


def sketched_crops(views: int, size_px: int = 48, room: int = 3) -> list[LitCrop]:
    """Views of one room with its first lamp on and its second off."""
    crops = SketchRooms(1000, size_px, 0).crops(room, views)
    on = np.arange(len(crops[0].on)) != 1
    return [replace(crop, on=on, exposure=1.0) for crop in crops]


def write_tiny_weights(folder: Path) -> tuple[Path, Path]:
    """Untrained sv and mv weights of a tiny network that still answers lamp by lamp."""
    torch.manual_seed(0)
    paths = (folder / "sv.safetensors", folder / "mv.safetensors")
    for path, kind in zip(paths, ("sv", "mv"), strict=True):
        net = LampNet(NetworkShape(*CHANNELS[kind], TINY))
        torch.nn.init.normal_(net.head.weight, std=0.02)
        save_weights(path, kind, net.shape, net.state_dict())
    return paths


def write_sketched_capture(root: Path, views: int, size_px: int = 48) -> dict[str, Path]:
    """capture, masks and splat folders of a sketched room; returns them by stage name."""
    crops = sketched_crops(views, size_px)
    folders = {name: root / name / "room" for name in ("capture", "masks", "splat")}
    photos = [
        View(f"{i:04d}.png", np.asarray(agx(c.image_linear), np.float32), c.camera)
        for i, c in enumerate(crops)
    ]
    points = Points(np.zeros((1, 3), np.float32), np.zeros((1, 3), np.uint8))
    write_capture(
        folders["capture"],
        "room",
        photos,
        points,
        source="sketch",
        metric=True,
        exposure=1.0,
        write_truth=lambda folder: _write_truth(folder, crops),
    )
    folders["masks"].mkdir(parents=True)
    write_masks(folders["masks"], _lamps(crops))
    for i, crop in enumerate(crops):
        layers = {"depth_m": crop.depth_m, "normal": crop.normal}
        write_exr(folders["splat"] / "depth" / f"{i:04d}.exr", layers, half=False)
    return folders


def _lamps(crops: list[LitCrop]) -> list[FoundLamp]:
    lamps = []
    for k in range(len(crops[0].on)):
        masks = {i: crop.masks[k] for i, crop in enumerate(crops) if crop.masks[k].any()}
        best = tuple(sorted(masks, key=lambda view: (-int(masks[view].sum()), view)))
        lamps.append(FoundLamp(f"lamp_{k}", bool(crops[0].on[k]), masks, best, k))
    return [lamp for lamp in lamps if lamp.masks]


def _write_truth(folder: Path, crops: list[LitCrop]) -> None:
    for i, crop in enumerate(crops):
        lights = {f"light_{k:02d}": light for k, light in enumerate(crop.lights)}
        write_exr(folder / f"{i:04d}.exr", {"ambient": crop.ambient, **lights})
        rays = np.linalg.norm(_rays(crop), axis=2)
        geometry = {"ray_distance_m": crop.depth_m * rays, "normal": crop.normal}
        write_exr(folder / f"{i:04d}.geometry.exr", geometry, half=False)
        masks = {f"emitter_{k:02d}": mask for k, mask in enumerate(crop.masks)}
        write_exr(folder / f"{i:04d}.masks.exr", masks)
    lamps = [
        {"id": f"lamp_{k}", "name": f"lamp_{k}", "on": bool(on), "scale": [1.0, 1.0, 1.0]}
        for k, on in enumerate(crops[0].on)
    ]
    write_json(folder / "lights.json", {"exposure": 1.0, "lamps": lamps, "room": "sketch"})


def _rays(crop: LitCrop) -> np.ndarray:
    camera = crop.camera
    x = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    y = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
    grid = np.meshgrid(x, y)
    return np.stack([*grid, np.ones_like(grid[0])], axis=2)
