"""Photos whose light is known, relit anew each time they are drawn."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from numpy.random import Generator

from luxcore.data.crops import LitCrop
from luxcore.data.lighting import draw_own_light, draw_relighting, exposed, one_more_burning

OWN_LIGHT_SHARE = 0.5
"""Of training photos: the other half gets lamps of any colour and power."""

DARK_SHARE = 0.2
"""Of photos: no lamp burns in them, as by day. Of photos with a lamp that is off, two in three show
no other one that burns."""

TRIPOD_SHARE = 0.5
"""Of photos: exposed for one lamp more than burns in them, as when somebody switches it off and
leaves the camera as it is."""


@runtime_checkable
class GroupSource(Protocol):
    """Overlapping photos of one room by number, as `luxcore.data.multiview.MultiViewSets` gives."""

    def crops(self, index: int, views: int) -> list[LitCrop]: ...

    def place(self, index: int) -> int:
        """Groups of one place are cheap to make one after the other."""
        ...


@dataclass(frozen=True)
class CropPool:
    """Groups of overlapping photos kept in memory: cutting and sketching them is paid for once."""

    groups: tuple[tuple[LitCrop, ...], ...]

    @staticmethod
    def collect(source: GroupSource, groups: Sequence[int], views: int) -> CropPool:
        """The groups of `source` with these numbers, `views` photos each, in this order.

        They are made place by place: a rendered room is read once, not once a group.
        """
        made = {i: tuple(source.crops(i, views)) for i in sorted(groups, key=source.place)}
        return CropPool(tuple(made[index] for index in groups))

    def __add__(self, other: CropPool) -> CropPool:
        return CropPool(self.groups + other.groups)

    def __len__(self) -> int:
        return len(self.groups)

    def photos(self) -> Iterator[LitCrop]:
        """Every photo of every group."""
        return (crop for group in self.groups for crop in group)

    def relit(self, rng: Generator, views: int | None = None) -> list[LitCrop]:
        """A random group in random order (`views` of it, or all), under new light or its own, or
        with all lamps off."""
        group = self.groups[int(rng.integers(len(self.groups)))]
        own_light = bool(rng.random() < OWN_LIGHT_SHARE)
        dark = bool(rng.random() < DARK_SHARE)
        order = rng.permutation(len(group))[:views]
        return relit([group[int(i)] for i in order], rng, own_light=own_light, dark=dark)


def relit(
    group: Sequence[LitCrop], rng: Generator, *, own_light: bool = False, dark: bool = False
) -> list[LitCrop]:
    """The same photos in the same order, all under one new light, or nearly under their own; with
    `dark`, under its ambient light alone."""
    on = group[0].on
    light = draw_own_light(rng, on) if own_light else draw_relighting(rng, len(on))
    if dark:
        light = replace(light, on=np.zeros_like(light.on))
    lit = [light.apply(crop) for crop in group]
    metered = one_more_burning(light.on, rng) if rng.random() < TRIPOD_SHARE else light.on
    return exposed(lit, rng, metered=metered)


def chw(image: np.ndarray) -> torch.Tensor:
    """[..., h, w, c] numpy to [..., c, h, w] float32 tensor."""
    return torch.from_numpy(np.ascontiguousarray(np.moveaxis(image, -1, -3), dtype=np.float32))
