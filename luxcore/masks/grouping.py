"""Bright regions of many views that are one lamp of the room.

Every pair of regions proposes a place where their rays meet. The place that falls on the most
lamp-like regions over all views is a lamp; its regions are taken out, and so on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from luxcore.cameras import Camera
from luxcore.capture.depth_points import pixel_rays
from luxcore.masks.blobs import Blob, work_size

MIN_SCORE = 2.5
"""Regions less lamp-like than this do not take part."""

PER_VIEW = 14
"""Most lamp-like regions of a view that take part."""

MIN_PARALLAX = np.radians(0.4)
TOLERANCE = 0.012
"""How far, as a fraction of the picture's longest side, a place may fall beside a region."""


@dataclass(frozen=True)
class ViewBlobs:
    """The regions of one view with their scores, and which of them a pixel of the grid is near."""

    camera: Camera
    blobs: tuple[Blob, ...]
    scores: tuple[float, ...]
    labels: np.ndarray
    """[h, w] int32 of the work grid: index of the region at or near the pixel, else -1."""


@dataclass
class Group:
    """A lamp in space and the regions that show it, by view."""

    place: Float[np.ndarray, " 3"]
    members: dict[int, list[int]] = field(default_factory=dict)
    score: float = 0.0
    """Mean lampness of the best region of each view."""


def view_blobs(camera: Camera, blobs: Sequence[Blob], scores: Sequence[float]) -> ViewBlobs:
    """Keep the most lamp-like regions and map the surroundings of each."""
    order = sorted(range(len(blobs)), key=lambda i: -scores[i])
    order = [i for i in order if scores[i] >= MIN_SCORE][:PER_VIEW]
    size = work_size(camera.height, camera.width)
    kept = tuple(blobs[i] for i in order)
    labels = _labels(kept, size)
    return ViewBlobs(camera, kept, tuple(scores[i] for i in order), labels)


def group_blobs(views: Sequence[ViewBlobs], limit: int) -> list[Group]:
    """At most `limit` lamps, those with the most evidence first."""
    places = _proposals(views)
    free = [np.array(view.scores) for view in views]
    hits = np.stack([_hits(view, places) for view in views], axis=1) if len(places) else None
    groups: list[Group] = []
    while hits is not None and len(groups) < limit:
        evidence = np.stack([_evidence(f, h) for f, h in zip(free, hits.T, strict=True)], axis=1)
        seen = (evidence > 0).sum(axis=1)
        total = np.where(seen >= _needed(len(views)), evidence.sum(axis=1), 0)
        best = int(total.argmax())
        if total[best] <= 0:
            break
        groups.append(_take(places[best], hits[best], views, free))
    return groups


def extent(group: Group, views: Sequence[ViewBlobs]) -> float:
    """Radius of the lamp in world units: half the diagonal where it shows nearly whole."""
    radii = []
    for view, members in group.members.items():
        camera = views[view].camera
        depth = float(camera.viewmat[2, :3] @ group.place + camera.viewmat[2, 3])
        for index in members:
            rows, columns = np.nonzero(views[view].blobs[index].region)
            grid = camera.width / views[view].labels.shape[1]
            diagonal = grid * np.hypot(np.ptp(rows) + 1, np.ptp(columns) + 1)
            radii.append(0.5 * diagonal * depth / camera.fx)
    return float(np.percentile(radii, 90)) if radii else 0.0


def project(
    camera: Camera, places: Float[np.ndarray, "n 3"]
) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, " n"]]:
    """(u, v) in pixels and depth along z; (u, v) means nothing where the depth is not positive."""
    local = places @ camera.viewmat[:3, :3].T + camera.viewmat[:3, 3]
    depth = local[:, 2]
    safe = np.where(depth > 1e-6, depth, 1.0)
    u = camera.fx * local[:, 0] / safe + camera.cx
    v = camera.fy * local[:, 1] / safe + camera.cy
    return np.stack([u, v], axis=1), depth


def _needed(views: int) -> int:
    return max(2, round(0.15 * views))


def _labels(blobs: Sequence[Blob], size: tuple[int, int]) -> np.ndarray:
    import cv2

    labels = np.full(size, -1, np.int32)
    nearest = np.full(size, TOLERANCE * max(size), np.float32)
    for index, blob in enumerate(blobs):
        outside = 1 - blob.on_grid(*size).astype(np.uint8)
        distance = cv2.distanceTransform(outside, cv2.DIST_L2, 3)
        closer = distance < nearest
        labels[closer], nearest[closer] = index, distance[closer]
    return labels


def _proposals(views: Sequence[ViewBlobs]) -> Float[np.ndarray, "n 3"]:
    """Where the rays of two regions of different views meet, in front of both cameras."""
    found = [np.zeros((0, 3))]
    rays = [_rays(view) for view in views]
    for a in range(len(views)):
        for b in range(a + 1, len(views)):
            if len(rays[a]) and len(rays[b]):
                found.append(
                    _meet(views[a].camera.centre, rays[a], views[b].camera.centre, rays[b])
                )
    return np.concatenate(found)


def _rays(view: ViewBlobs) -> np.ndarray:
    centres = np.array([b.centre for b in view.blobs]).reshape(-1, 2)
    return pixel_rays(
        view.camera, centres[:, 0] * view.camera.width, centres[:, 1] * view.camera.height
    )


def _meet(origin_a: np.ndarray, a: np.ndarray, origin_b: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Midpoints of the shortest links between all rays of a and all of b."""
    a, b = np.broadcast_arrays(a[:, None], b[None])
    base = origin_b - origin_a
    cosine = (a * b).sum(-1)
    sine2 = np.maximum(1 - cosine**2, 1e-12)
    on_a, on_b = a @ base, b @ base
    s = (on_a - cosine * on_b) / sine2
    t = (cosine * on_a - on_b) / sine2
    gap = np.linalg.norm(base + t[..., None] * b - s[..., None] * a, axis=-1)
    middle = 0.5 * (origin_a + s[..., None] * a + origin_b + t[..., None] * b)
    usable = (s > 0) & (t > 0) & (np.sqrt(sine2) > MIN_PARALLAX) & (gap < 0.05 * np.minimum(s, t))
    return middle[usable]


def _hits(view: ViewBlobs, places: np.ndarray) -> np.ndarray:
    """Index of the region that each place falls on in this view, else -1."""
    uv, depth = project(view.camera, places)
    rows, columns = view.labels.shape
    x = np.floor(uv[:, 0] * columns / view.camera.width)
    y = np.floor(uv[:, 1] * rows / view.camera.height)
    inside = (depth > 1e-6) & (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
    hit = np.full(len(places), -1)
    hit[inside] = view.labels[y[inside].astype(int), x[inside].astype(int)]
    return hit


def _evidence(free: np.ndarray, hit: np.ndarray) -> np.ndarray:
    """Score of the region hit, above what does not count; 0 where none or already taken."""
    if not len(free):
        return np.zeros(len(hit))
    return np.where(hit >= 0, np.maximum(free[hit] - MIN_SCORE, 0), 0)


def _take(
    place: np.ndarray, hits: np.ndarray, views: Sequence[ViewBlobs], free: list[np.ndarray]
) -> Group:
    group, scores = Group(place), []
    for view, hit in enumerate(hits):
        if hit >= 0 and free[view][hit] > MIN_SCORE:
            group.members[view] = [int(hit)]
            scores.append(views[view].scores[hit])
            free[view][hit] = -np.inf
    group.score = float(np.mean(scores))
    return group
