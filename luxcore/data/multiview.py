"""Sets of overlapping photos of one room under one light, for the multi-view model.

A set starts with a photo that shows a lamp; each next photo overlaps with what is already seen and
adds the most that is new (paper, supplement, On-the-fly sampling). Set `i` depends on nothing but
the views, the size, the seed and i.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from luxcore.data.compact import MASK_KINDS
from luxcore.data.coverage import Pose, Sight, sight
from luxcore.data.crops import LitCrop, with_lamps
from luxcore.data.lighting import draw_relighting, exposed
from luxcore.data.panorama import view_rotation
from luxcore.data.store import AnyView, ViewStore
from luxcore.data.training import FOV_DEG, aimed_pose, as_arrays, generator, lamps_in_sight
from luxcore.errors import InputError

CANDIDATES = 16
OVERLAP = (0.15, 0.85)
"""A next photo shares at least and at most this much with what is already seen, if it can."""
MIN_MEDIAN_M = 1.0
MIN_NEAR_M = 0.35
_ELEVATION_SPREAD_DEG = 10.0


class MultiViewSets:
    """Sets of photos by number; all photos of a set show one room and carry the same lamps."""

    def __init__(
        self,
        views: Sequence[AnyView],
        size: tuple[int, int],
        seed: int,
        *,
        views_per_set: int = 8,
        relit: bool = True,
        mask_kinds: Sequence[str] = MASK_KINDS,
    ) -> None:
        """`size` is (height, width). Raises InputError without views or with fewer than 1 a set."""
        if views_per_set < 1:
            raise InputError(f"a set needs at least 1 view, got {views_per_set}.")
        self.store = ViewStore(views)
        self.size, self.seed, self.relit = size, seed, relit
        self.views_per_set, self.mask_kinds = views_per_set, tuple(mask_kinds)
        rooms: dict[str, list[int]] = {}
        for number in range(len(self.store)):
            rooms.setdefault(self.store.room(number), []).append(number)
        self.rooms = list(rooms.values())

    def __len__(self) -> int:
        return len(self.rooms)

    def __getitem__(self, index: int) -> dict[str, np.ndarray]:
        """The arrays of `as_arrays`, each with a leading axis of views."""
        photos = [as_arrays(crop) for crop in self.crops(index, self.views_per_set)]
        return {name: np.stack([photo[name] for photo in photos]) for name in photos[0]}

    def crops(self, index: int, views: int) -> list[LitCrop]:
        """The photos of set `index`, the one that shows the target lamp (lamp 0) first.

        Fewer than `views` where a room of perspective views has no more. Lamps that no photo of
        the set shows are part of the ambient light of all.
        """
        numbers = self.rooms[self.place(index)]
        rng = generator(self.seed, 3, index)
        mask_kind = str(rng.choice(self.mask_kinds))
        target, poses = self._poses(numbers, rng, views, mask_kind)
        crops = [self._take(pose, mask_kind) for pose in poses]
        if self.relit:
            relighting = draw_relighting(rng, len(crops[0].on))
            crops = exposed([relighting.apply(crop) for crop in crops], rng)
        else:
            shared = float(np.median([crop.exposure for crop in crops]))
            crops = [replace(crop, exposure=shared) for crop in crops]
        return self._with_seen_lamps(crops, target)

    def place(self, index: int) -> int:
        """Which of `rooms` set `index` shows; sets of one room are cheap to cut together."""
        epoch, place = divmod(index, len(self.rooms))
        return int(generator(self.seed, 2, epoch).permutation(len(self.rooms))[place])

    def _with_seen_lamps(self, crops: list[LitCrop], target: int | None) -> list[LitCrop]:
        seen = {i for crop in crops for i in lamps_in_sight(crop.masks, None)}
        kept = sorted(seen, key=lambda i: (i != target, i))
        return [with_lamps(crop, kept) for crop in crops]

    def _take(self, pose: Pose, mask_kind: str) -> LitCrop:
        height, width = self.size
        source = self.store.source(pose.number)
        if pose.rotation is None:
            return source.whole(width, height, mask_kind)
        return source.cut(pose.rotation, pose.fov_x_deg, width, height, mask_kind)

    def _poses(
        self, numbers: list[int], rng: Generator, views: int, mask_kind: str
    ) -> tuple[int | None, list[Pose]]:
        target, first = self._first(numbers, rng, mask_kind)
        poses, aspect = [first], self.size[1] / self.size[0]
        seen = set(sight(self.store.source(first.number), first, aspect).boxes)
        while len(poses) < views:
            candidates = self._candidates(numbers, rng, poses)
            if not candidates:
                break
            sights = [sight(self.store.source(p.number), p, aspect) for p in candidates]
            best = max(range(len(candidates)), key=lambda i: (_worth(sights[i], seen), -i))
            poses.append(candidates[best])
            seen |= sights[best].boxes
        return target, poses

    def _first(self, numbers: list[int], rng: Generator, mask_kind: str) -> tuple[int | None, Pose]:
        """A pose that shows a lamp; views are tried in random order until one does."""
        order = [int(n) for n in rng.permutation(numbers)]
        found: list[tuple[int | None, Pose]] = []
        for number in order:
            source = self.store.source(number)
            if source.view.kind == "perspective":
                seen = lamps_in_sight(source.view.masks[mask_kind], None)
                lamp = int(rng.choice(seen)) if seen else None
                found.append((lamp, Pose(number, None, 0.0)))
            else:
                aspect = self.size[1] / self.size[0]
                lamp, fov, rotation = aimed_pose(source, rng, aspect, mask_kind)
                found.append((lamp, Pose(number, rotation, fov)))
            if lamp is not None:
                return found[-1]
        return found[0]

    def _candidates(self, numbers: list[int], rng: Generator, taken: list[Pose]) -> list[Pose]:
        whole = {pose.number for pose in taken if pose.rotation is None}
        candidates = []
        for number in numbers:
            if self.store.source(number).view.kind == "perspective" and number not in whole:
                candidates.append(Pose(number, None, 0.0))
        panoramas = [n for n in numbers if self.store.source(n).view.kind == "panorama"]
        for _ in range(CANDIDATES if panoramas else 0):
            elevation = float(rng.normal(0.0, _ELEVATION_SPREAD_DEG))
            rotation = view_rotation(float(rng.uniform(-180, 180)), elevation)
            fov = float(rng.uniform(*FOV_DEG))
            candidates.append(Pose(int(rng.choice(panoramas)), rotation, fov))
        return candidates


def _worth(candidate: Sight, seen: set[tuple[int, int, int]]) -> float:
    """New boxes that a pose adds; poses without overlap or close to a wall come after the rest."""
    overlap = candidate.overlap(seen)
    fit = OVERLAP[0] <= overlap <= OVERLAP[1]
    clear = candidate.median_m >= MIN_MEDIAN_M and candidate.nearest_m >= MIN_NEAR_M
    new = len(candidate.boxes - seen)
    return new + 1e6 * (overlap >= OVERLAP[0]) + 1e5 * clear + 1e4 * fit
