"""Bright regions of a photo that may be lamps, with what distinguishes a lamp from a bright thing.

All nested regions above falling brightness thresholds are candidates; of those that overlap, the
one with the sharpest edge and the highest contrast stays: the shade rather than its glow.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from luxcore.light.agx import agx_inverse

WORK_SIDE = 512
"""Longest side, pixels, at which regions are looked for: lamps are not thinner than its pixels."""

THRESHOLDS = np.linspace(0.985, 0.5, 18)
"""Of the mean of the display channels."""

MIN_CORE, MIN_CONTRAST_STOPS, MIN_SOLIDITY = 0.75, 1.0, 0.4
_LINEAR_FLOOR = 0.01
"""Added before logarithms, so that noise in black channels is no contrast."""


@dataclass(frozen=True)
class Cues:
    """What a lamp looks like, as numbers. Stops are base-2 logarithms of linear light."""

    core: float
    """85th percentile of the brightest channel inside, display 0..1."""
    contrast_stops: float
    """Inside against the surroundings one to two radii away, best channel."""
    glow_stops: float
    """Near surroundings against farther ones: a lamp lights what is around it."""
    surround_stops: float
    """Farther surroundings against the whole photo."""
    solidity: float
    """Area over the area of the convex hull, 0..1."""
    edge: float
    """Mean display gradient per pixel along the outline."""
    warmth: float
    """Red minus blue, less the same of the photo's bright parts: daylight is cooler than lamps."""
    sides_cut: int
    """How many sides of the picture cut it."""


@dataclass(frozen=True)
class Blob:
    """One bright region on the work grid; `region` lies at rows top.., columns left.. of it."""

    top: int
    left: int
    region: Bool[np.ndarray, "h w"]
    area: float
    """Fraction of the picture's pixels."""
    centre: tuple[float, float]
    """(u, v) of its centroid as fractions of width and height."""
    cues: Cues

    def on_grid(self, height: int, width: int) -> Bool[np.ndarray, "H W"]:
        """The region as a full mask of the work grid."""
        mask = np.zeros((height, width), bool)
        rows, columns = self.region.shape
        mask[self.top : self.top + rows, self.left : self.left + columns] = self.region
        return mask


@dataclass(frozen=True)
class _Planes:
    """The photo on the work grid, in the forms that the cues need."""

    display: np.ndarray
    brightness: np.ndarray
    gradient: np.ndarray
    stops: np.ndarray
    mean_stops: np.ndarray
    scene_stops: float
    scene_warmth: float


def work_size(height: int, width: int) -> tuple[int, int]:
    """(height, width) of the grid that a photo is looked at on."""
    factor = min(1.0, WORK_SIDE / max(height, width))
    return max(1, round(height * factor)), max(1, round(width * factor))


def find_blobs(photo: Float[np.ndarray, "h w 3"], min_area: float, max_area: float) -> list[Blob]:
    """Bright regions of a display-referred photo that do not overlap, clearest first.

    Areas are fractions of the picture.
    """
    planes = _planes(photo)
    found = list(_all_regions(planes, min_area, max_area))
    found.sort(key=lambda b: -b.cues.edge * max(b.cues.contrast_stops, 0) * b.cues.solidity)
    used = np.zeros(planes.brightness.shape, bool)
    kept = []
    for blob in found:
        rows, columns = blob.region.shape
        place = used[blob.top : blob.top + rows, blob.left : blob.left + columns]
        if not (place & blob.region).any():
            place |= blob.region
            kept.append(blob)
    return kept


def _planes(photo: np.ndarray) -> _Planes:
    import cv2

    height, width = work_size(*photo.shape[:2])
    display = cv2.resize(photo, (width, height), interpolation=cv2.INTER_AREA)
    mean = display.mean(axis=2)
    brightness = cv2.GaussianBlur(mean, (0, 0), 0.7)
    # Scharr's weights sum to 32 over two pixels of distance: this is the slope per pixel.
    slopes = [cv2.Scharr(brightness, cv2.CV_32F, *axis) / 32 for axis in ((1, 0), (0, 1))]
    linear = np.maximum(agx_inverse(display), 1e-3)
    stops, mean_stops = np.log2(linear + _LINEAR_FLOOR), np.log2(linear.mean(axis=2))
    bright = mean >= np.percentile(mean, 70)
    warmth = float(np.median((display[..., 0] - display[..., 2])[bright]))
    scene = float(np.median(mean_stops))
    return _Planes(display, brightness, np.hypot(*slopes), stops, mean_stops, scene, warmth)


def _all_regions(planes: _Planes, min_area: float, max_area: float) -> Iterator[Blob]:
    import cv2

    pixels = planes.brightness.size
    smallest, largest = max(8, min_area * pixels), max_area * pixels
    for threshold in THRESHOLDS:
        above = (planes.brightness >= threshold).astype(np.uint8)
        count, labels, boxes, centroids = cv2.connectedComponentsWithStats(above, connectivity=8)
        for label in range(1, count):
            if not smallest <= boxes[label][cv2.CC_STAT_AREA] <= largest:
                continue
            blob = _region(planes, labels, label, boxes[label], centroids[label])
            if blob is not None and _plausible(blob.cues):
                yield blob


def _plausible(cues: Cues) -> bool:
    return (
        cues.core > MIN_CORE
        and cues.contrast_stops > MIN_CONTRAST_STOPS
        and cues.solidity > MIN_SOLIDITY
    )


def _region(
    planes: _Planes, labels: np.ndarray, label: int, box: np.ndarray, centroid: np.ndarray
) -> Blob | None:
    x, y, width, height, area = (int(v) for v in box)
    rows, columns = labels.shape
    near_radius = max(2, int(0.3 * math.sqrt(area)))
    far_radius = 2 * near_radius + 2
    top, left = max(0, y - far_radius - 1), max(0, x - far_radius - 1)
    bottom, right = min(rows, y + height + far_radius + 1), min(columns, x + width + far_radius + 1)
    crop = slice(top, bottom), slice(left, right)
    region = labels[crop] == label
    cut = (x == 0) + (y == 0) + (x + width == columns) + (y + height == rows)
    cues = _cues(planes, crop, region, near_radius, far_radius, cut)
    if cues is None:
        return None
    centre = (float(centroid[0] + 0.5) / columns, float(centroid[1] + 0.5) / rows)
    return Blob(top, left, region, area / (rows * columns), centre, cues)


def _cues(
    planes: _Planes,
    crop: tuple[slice, slice],
    region: np.ndarray,
    near_radius: int,
    far_radius: int,
    cut: int,
) -> Cues | None:
    import cv2

    distance = cv2.distanceTransform((~region).astype(np.uint8), cv2.DIST_L2, 3)
    near = (distance > 1.5) & (distance <= near_radius)
    far = (distance > near_radius) & (distance <= far_radius)
    outline = region & ~_eroded(region)
    if min(near.sum(), far.sum(), outline.sum()) < 4:
        return None
    stops, mean_stops, display = planes.stops[crop], planes.mean_stops[crop], planes.display[crop]
    inside = np.median(stops[region], axis=0)
    far_stops = float(np.median(mean_stops[far]))
    colour = display[region].mean(axis=0)
    return Cues(
        core=float(np.percentile(display[region].max(axis=1), 85)),
        contrast_stops=float((inside - np.median(stops[far], axis=0)).max()),
        glow_stops=float(np.median(mean_stops[near])) - far_stops,
        surround_stops=far_stops - planes.scene_stops,
        solidity=_solidity(region),
        edge=float(planes.gradient[crop][outline].mean()),
        warmth=float(colour[0] - colour[2]) - planes.scene_warmth,
        sides_cut=int(cut),
    )


def _eroded(region: np.ndarray) -> np.ndarray:
    import cv2

    # Pixels at the picture's edge are no outline of the lamp: outside counts as inside.
    padded = np.pad(region.astype(np.uint8), 1, constant_values=1)
    return cv2.erode(padded, np.ones((3, 3), np.uint8))[1:-1, 1:-1] > 0


def _solidity(region: np.ndarray) -> float:
    import cv2

    outlines, _ = cv2.findContours(
        region.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
    )
    hull = cv2.convexHull(np.concatenate(outlines))
    # The hull runs through pixel centres; half its length is the half pixel around it.
    area = cv2.contourArea(hull) + 0.5 * cv2.arcLength(hull, True)
    return float(min(1.0, region.sum() / max(area, 1.0)))
