"""Tile lists: sorted, complete, and tight."""

from __future__ import annotations

import numpy as np
import torch
from engine_scenes import NAMES, camera_at_origin, on_device, random_scene

from luxcore.splats.device import open_device
from luxcore.splats.rasterizer import RasterConfig, Rasterizer
from luxcore.splats.rasterizer.config import ALPHA_MIN
from luxcore.splats.twin import project_gaussians


def reached_tiles(camera, config, scene) -> tuple[set[tuple[int, int]], np.ndarray]:
    """((tile, Gaussian) pairs with a pixel of alpha >= ALPHA_MIN, depths): by trying all pixels."""
    p = project_gaussians(
        camera, config, *(torch.tensor(getattr(scene, n), dtype=torch.float64) for n in NAMES[:4])
    )
    ys, xs = np.mgrid[: camera.height, : camera.width] + 0.5
    pairs = set()
    for g in np.flatnonzero(p.visible.numpy()):
        dx, dy = p.mean2d[g, 0].item() - xs, p.mean2d[g, 1].item() - ys
        a, b, c = p.conic[g].tolist()
        power = 0.5 * (a * dx * dx + c * dy * dy) + b * dx * dy
        seen = p.opacity[g].item() * np.exp(-power) >= ALPHA_MIN
        tiles = (ys[seen] // 16).astype(int) * -(-camera.width // 16) + (xs[seen] // 16).astype(int)
        pairs |= {(int(t), int(g)) for t in np.unique(tiles)}
    return pairs, p.depth.numpy()


def test_lists_hold_every_pair_that_is_seen_and_few_more():
    camera, config, scene = camera_at_origin(), RasterConfig(), random_scene(400)
    device = open_device()
    out = Rasterizer(device, config).forward(camera, *on_device(device, scene))
    ranges, ids = out.saved.ranges.get(), out.saved.sorted_ids.get()
    listed = [(t, int(g)) for t, (a, b) in enumerate(ranges) for g in ids[a:b]]
    needed, depth = reached_tiles(camera, config, scene)
    assert len(listed) == len(set(listed)) == out.intersections
    assert needed <= set(listed)
    # The bound is the ellipse itself: what it adds are corners between pixel centres.
    assert len(listed) <= 1.1 * len(needed)
    keys = [(t, np.float32(depth[g]), g) for t, g in listed]
    assert keys == sorted(keys)


def test_a_gaussian_taller_than_eight_rows_of_tiles_is_listed_in_all():
    camera = camera_at_origin(40, 500, 400.0)
    scene = random_scene(30, camera=camera, scale=0.5)
    device = open_device()
    out = Rasterizer(device, RasterConfig()).forward(camera, *on_device(device, scene))
    ranges, ids = out.saved.ranges.get(), out.saved.sorted_ids.get()
    listed = {(t, int(g)) for t, (a, b) in enumerate(ranges) for g in ids[a:b]}
    needed, _ = reached_tiles(camera, RasterConfig(), scene)
    assert out.radii.get().max() > 200
    assert needed <= listed
