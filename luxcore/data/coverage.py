"""What a view sees of its room, as a set of small boxes in the world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from luxcore.data.crops import ViewSource
from luxcore.data.panorama import pixel_directions, sample_padded

BOX_M = 0.4
_SIDE = 20
"""A pose is judged by a grid of this many columns."""
FAR_M = 15.0
"""What lies farther is outside a window and covers nothing of the room."""
_NEAR_SHARE = 0.05


@dataclass(frozen=True)
class Pose:
    """A photo to be taken of view `number`: a cut of a panorama, or a perspective view whole."""

    number: int
    rotation: Float[np.ndarray, "3 3"] | None
    """Camera to panorama axes; None: the whole perspective view."""
    fov_x_deg: float


@dataclass(frozen=True)
class Sight:
    """The boxes that a pose sees, and how close it is to what it looks at."""

    boxes: frozenset[tuple[int, int, int]]
    median_m: float
    nearest_m: float
    """Distance that 5 % of the picture is closer than."""

    def overlap(self, seen: set[tuple[int, int, int]]) -> float:
        """Share of what this pose sees that is in `seen`."""
        return len(self.boxes & seen) / max(1, len(self.boxes))


def sight(source: ViewSource, pose: Pose, aspect: float) -> Sight:
    """A coarse grid of distances projected into the world (paper, On-the-fly sampling)."""
    distance, directions = _rays(source, pose, max(2, round(_SIDE / aspect)))
    known = (distance > 0) & (distance < FAR_M)
    distance, directions = distance[known], directions[known]
    if distance.size == 0:
        return Sight(frozenset(), 0.0, 0.0)
    points = source.view.c2w[:3, 3] + distance[:, None] * directions
    boxes = frozenset(map(tuple, np.floor(points / BOX_M).astype(int).tolist()))
    near = float(np.quantile(distance, _NEAR_SHARE))
    return Sight(boxes, float(np.median(distance)), near)


def _rays(source: ViewSource, pose: Pose, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Distances [n] and unit world directions [n, 3] of a coarse grid of the pose's pixels."""
    turn = source.view.c2w[:3, :3]
    if pose.rotation is None:
        return _perspective_rays(source)
    grid = sample_padded(source.sharp[:1], pose.rotation, pose.fov_x_deg, _SIDE, rows, nearest=True)
    rays = pixel_directions(pose.fov_x_deg, _SIDE, rows).numpy()
    directions = rays.reshape(-1, 3) @ (turn @ pose.rotation).T
    return grid[0].numpy().ravel(), directions


def _perspective_rays(source: ViewSource) -> tuple[np.ndarray, np.ndarray]:
    camera = source.view.camera
    assert camera is not None, "only a perspective view is taken whole"
    step = max(1, camera.width // _SIDE)
    v, u = np.mgrid[step // 2 : camera.height : step, step // 2 : camera.width : step]
    local = np.stack(
        [(u + 0.5 - camera.cx) / camera.fx, (v + 0.5 - camera.cy) / camera.fy, np.ones(u.shape)], -1
    ).reshape(-1, 3)
    local /= np.linalg.norm(local, axis=1, keepdims=True)
    return source.view.ray_distance_m[v, u].ravel(), local @ camera.c2w[:3, :3].T
