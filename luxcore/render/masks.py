"""The three masks of each lamp and the mask of the windows, from the renderer's object indices."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import NDArray

MIN_EMITTER_PIXELS = 24
"""An emitter mask smaller than this (but not empty) is dilated until it reaches it."""

IndexMap = Float[np.ndarray, "h w"]
Mask = Bool[np.ndarray, "h w"]


def lamp_masks(
    index: IndexMap, lamps: int, *, fixture_code: int, emitter_code: int, wraps: bool
) -> dict[str, Mask]:
    """`emitter_00`, `fixture_00`, `hull_00`, … from an image of object indices.

    Lamp i owns the indices 10·(i+1) + code. The fixture includes the emitter. `wraps`: the left
    and right edge of the image touch (panoramas).
    """
    codes = np.rint(index).astype(int)
    masks: dict[str, Mask] = {}
    for lamp in range(lamps):
        base = 10 * (lamp + 1)
        emitter = codes == base + emitter_code
        fixture = emitter | (codes == base + fixture_code)
        masks[f"emitter_{lamp:02d}"] = grown(emitter, MIN_EMITTER_PIXELS, wraps)
        masks[f"fixture_{lamp:02d}"] = fixture
        masks[f"hull_{lamp:02d}"] = convex_hull(fixture, wraps)
    return masks


def grown(mask: Mask, minimum: int, wraps: bool) -> Mask:
    """Dilate (3x3) until `minimum` pixels are on; an empty mask stays empty."""
    while 0 < mask.sum() < min(minimum, mask.size):
        mask = dilated(mask, wraps)
    return mask


def dilated(mask: Mask, wraps: bool) -> Mask:
    """One step of 3x3 dilation."""
    padded = np.pad(mask, ((0, 0), (1, 1)), mode="wrap" if wraps else "constant")
    wide = padded[:, :-2] | padded[:, 1:-1] | padded[:, 2:]
    tall = np.pad(wide, ((1, 1), (0, 0)))
    return tall[:-2] | tall[1:-1] | tall[2:]


def convex_hull(mask: Mask, wraps: bool) -> Mask:
    """The filled convex hull of the pixels that are on, in the image plane.

    On a panorama the image is first turned so that the mask does not cross the seam.
    """
    if not mask.any():
        return mask.copy()
    shift = _seam_shift(mask) if wraps else 0
    turned = np.roll(mask, shift, axis=1)
    hull = _half_planes(_corner_points(turned), turned.shape)
    return np.roll(hull, -shift, axis=1)


def _seam_shift(mask: Mask) -> int:
    """Columns to roll by so that the widest empty run of columns holds the seam."""
    columns = mask.any(axis=0)
    width = len(columns)
    used = np.flatnonzero(columns)
    if len(used) == width:
        return 0
    gaps = np.diff(np.append(used, used[0] + width))
    widest = int(np.argmax(gaps))
    return int(-(used[widest] + gaps[widest] // 2) % width)


def _corner_points(mask: Mask) -> NDArray[np.float64]:
    """First and last pixel of every row as (x, y), enough for the hull."""
    rows = np.flatnonzero(mask.any(axis=1))
    first = mask[rows].argmax(axis=1)
    last = mask.shape[1] - 1 - mask[rows, ::-1].argmax(axis=1)
    return np.concatenate([np.stack([first, rows], 1), np.stack([last, rows], 1)]).astype(float)


def _half_planes(points: NDArray[np.float64], shape: tuple[int, ...]) -> Mask:
    hull = _monotone_chain(points)
    y, x = np.mgrid[0 : shape[0], 0 : shape[1]]
    inside = np.ones(shape, bool)
    if len(hull) < 3:
        low, high = points.min(axis=0), points.max(axis=0)
        box = (x >= low[0]) & (x <= high[0]) & (y >= low[1]) & (y <= high[1])
        return box & (_line_distance(hull, x, y) <= 0.5)
    for start, end in zip(hull, np.roll(hull, -1, axis=0), strict=True):
        side = (end[0] - start[0]) * (y - start[1]) - (end[1] - start[1]) * (x - start[0])
        inside &= side >= -1e-9
    return inside


def _line_distance(hull: NDArray[np.float64], x: np.ndarray, y: np.ndarray) -> np.ndarray:
    if len(hull) < 2:
        return np.zeros(x.shape)
    direction = (hull[1] - hull[0]) / np.linalg.norm(hull[1] - hull[0])
    return np.abs((x - hull[0][0]) * direction[1] - (y - hull[0][1]) * direction[0])


def _monotone_chain(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Andrew's convex hull, counter-clockwise in (x, y), without collinear points."""
    ordered = np.unique(points, axis=0)
    if len(ordered) < 3:
        return ordered

    def half(sequence: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        chain: list[NDArray[np.float64]] = []
        for point in sequence:
            while len(chain) >= 2 and _turn(chain[-2], chain[-1], point) <= 0:
                chain.pop()
            chain.append(point)
        return chain[:-1]

    return np.array(half(ordered) + half(ordered[::-1]))


def _turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
