"""Where to stand in a room of which only its surfaces are known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

CLEARANCE_M = 0.35
"""A standpoint is at least this far from every surface, if any is."""
APART_M = 1.0
"""Two standpoints nearer than this see the same."""
GRID = 14
_SAMPLES = 60_000
_SEED = 0


def standpoints(
    triangles_m: Float[np.ndarray, "n 3 3"],
    eye_height_m: float,
    wanted: Sequence[np.ndarray],
    count: int,
) -> list[Float[np.ndarray, " 3"]]:
    """Up to `count` points: those `wanted` that are free (the file's cameras), then a grid's.

    Wanted points outside of the bounds count where none is inside: things on a table are looked
    at from outside, no farther than twice the bounds' diagonal. Each next point of the grid is
    the one farthest from those before, among those with room; the first one has most room. There
    is always one: where nothing is free, the freest.
    """
    from scipy.spatial import cKDTree

    low, high = triangles_m.min(axis=(0, 1)), triangles_m.max(axis=(0, 1))
    surfaces = cKDTree(_samples(triangles_m))
    outside_m = [float(np.linalg.norm(p - np.clip(p, low, high))) for p in wanted]
    near_m = 2 * float(np.linalg.norm(high - low)) if min(outside_m, default=0.0) > 0 else 0.0
    chosen: list[np.ndarray] = []
    for point in (p for p, gap in zip(wanted, outside_m, strict=True) if gap <= near_m):
        if (
            len(chosen) < count
            and surfaces.query(point)[0] >= CLEARANCE_M
            and _apart(point, chosen)
        ):
            chosen.append(np.asarray(point, float))
    grid = _grid(low, high, eye_height_m)
    # More room than up to the floor is of no use.
    room = np.minimum(surfaces.query(grid)[0], eye_height_m).round(2)
    from_middle = np.linalg.norm(grid[:, :2] - (low + high)[:2] / 2, axis=1)
    if not chosen:
        chosen.append(grid[np.lexsort((from_middle, -room))[0]])
    free = grid[room >= CLEARANCE_M]
    while len(chosen) < count and len(free):
        gaps = np.linalg.norm(free[:, None] - np.array(chosen), axis=2).min(axis=1)
        best = int(gaps.argmax())
        if gaps[best] < APART_M:
            break
        chosen.append(free[best])
    return chosen


def _grid(low: np.ndarray, high: np.ndarray, eye_height_m: float) -> np.ndarray:
    steps = (np.arange(GRID) + 0.5) / GRID
    x, y = np.meshgrid(low[0] + steps * (high - low)[0], low[1] + steps * (high - low)[1])
    return np.stack([x.ravel(), y.ravel(), np.full(x.size, low[2] + eye_height_m)], axis=1)


def _samples(triangles: np.ndarray) -> np.ndarray:
    """Points on the surfaces, by area, and all corners."""
    edges = triangles[:, 1:] - triangles[:, :1]
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    rng = np.random.Generator(np.random.PCG64(_SEED))
    share = area / area.sum() if area.sum() > 0 else None
    which = rng.choice(len(triangles), _SAMPLES, p=share)
    u, v = rng.random((2, _SAMPLES, 1))
    flip = u + v > 1
    u, v = np.where(flip, 1 - u, u), np.where(flip, 1 - v, v)
    points = triangles[which, 0] + u * edges[which, 0] + v * edges[which, 1]
    return np.concatenate([points, triangles.reshape(-1, 3)])


def _apart(point: np.ndarray, others: Sequence[np.ndarray]) -> bool:
    return all(float(np.linalg.norm(point - other)) >= APART_M for other in others)
