"""A panorama without a renderer: a grey sphere of a room with two glowing lamps."""

from __future__ import annotations

import numpy as np

from luxcore.data.compact import Lamp, RenderedView
from luxcore.data.panorama import directions_of_pixels

LAMPS = (("ceiling", (0.0, 1.0, 0.6)), ("floor", (1.0, -0.4, -0.2)))
DISTANCE_M = 3.0


def panorama(height: int = 64, offset_m: float = 0.0) -> RenderedView:
    """Two lamps of 0.3 rad; each lights the wall around it, and the ambient light all of it."""
    directions = directions_of_pixels(height, 2 * height)
    towards = [np.array(where) / np.linalg.norm(where) for _, where in LAMPS]
    angles = [np.arccos(np.clip(directions @ axis, -1, 1)) for axis in towards]
    emitters = np.stack([angle < 0.3 for angle in angles])
    texture = 0.3 + 0.2 * np.sin(8 * directions)  # [h, w, 3]
    lights = np.stack([texture * np.exp(-(angle**2))[..., None] for angle in angles])
    lights[emitters] = 6.0
    c2w = np.eye(4)
    c2w[0, 3] = offset_m
    return RenderedView(
        room="sphere",
        kind="panorama",
        c2w=c2w,
        camera=None,
        ambient=(0.05 * texture).astype(np.float32),
        lights=lights.astype(np.float32),
        albedo=texture.astype(np.float32),
        normal=(-directions).astype(np.float32),
        ray_distance_m=np.full(directions.shape[:2], DISTANCE_M, np.float32),
        masks={kind: emitters for kind in ("emitter", "fixture", "hull")},
        window=np.zeros(directions.shape[:2], bool),
        lamps=tuple(
            Lamp(f"lamp_{i}", kind, (0.0, 0.0, 0.0), 10.0, (1.0, 1.0, 1.0), True, (1.0, 0.9, 0.8))
            for i, (kind, _) in enumerate(LAMPS)
        ),
        exposure=1.0,
    )
