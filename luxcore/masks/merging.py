"""A lamp that something in front of it splits into pieces is still one lamp."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from luxcore.masks.grouping import Group, ViewBlobs, extent, project

REACH = 1.25
"""Two pieces belong together when their centres are closer than this times both extents.

Above 1, since what hides the middle of a lamp hides part of its extent too."""

THIN = 0.4
"""Width over length up to which a region is a strip."""

ALIGNED = 0.97
"""Cosine of the angle between strips and the line that joins them, at least: about 14 degrees."""

SAME_WIDTH = 1.8
MAX_GAP = 1.35
"""Between the ends of two strips, as a multiple of the longer one."""

PIECE_SCORE = 3.5
"""A piece may be less lamp-like than a whole lamp, but not less than this."""


def merge_pieces(groups: Sequence[Group], views: Sequence[ViewBlobs]) -> list[Group]:
    """Join groups that are one lamp, in the order of the first pieces."""
    merged: list[Group] = []
    for group in groups:
        partner = next((m for m in merged if _one_lamp(m, group, views)), None)
        if partner is None:
            merged.append(group)
            continue
        for view, members in group.members.items():
            partner.members.setdefault(view, []).extend(members)
    return merged


def add_pieces(groups: Sequence[Group], views: Sequence[ViewBlobs]) -> None:
    """Give each lamp the free regions that lie within its extent, in every view that shows it."""
    taken = {(v, i) for g in groups for v, members in g.members.items() for i in members}
    for group in groups:
        size = extent(group, views)
        for index in sorted(group.members):
            view = views[index]
            for number, score in enumerate(view.scores):
                free = (index, number) not in taken and score >= PIECE_SCORE
                if free and _within(view, number, group, size):
                    group.members[index].append(number)
                    taken.add((index, number))


def _one_lamp(a: Group, b: Group, views: Sequence[ViewBlobs]) -> bool:
    size = extent(a, views)
    if np.linalg.norm(a.place - b.place) < REACH * (size + extent(b, views)):
        return True
    # What hides the lamp moves along it from view to view, so that the rays of a piece can meet
    # far from the lamp; in the pictures the piece still lies within it.
    covered = [_within(views[v], b.members[v][0], a, size) for v in b.members]
    if np.mean(covered) > 0.5:
        return True
    shared = sorted(set(a.members) & set(b.members))
    lined_up = [_in_line(views[v], a.members[v][0], b.members[v][0]) for v in shared]
    return len(shared) >= 2 and float(np.mean(lined_up)) >= 0.5


def _within(view: ViewBlobs, index: int, group: Group, size: float) -> bool:
    """Whether a region's centre lies in the lamp's reprojected extent."""
    centre, depth = project(view.camera, group.place[None])
    place = np.array(view.blobs[index].centre) * (view.camera.width, view.camera.height)
    reach = size * view.camera.fx / max(float(depth[0]), 1e-9)
    return bool(depth[0] > 0 and np.linalg.norm(place - centre[0]) < reach)


def _in_line(view: ViewBlobs, a: int, b: int) -> bool:
    """Whether two regions continue each other, as a strip does behind a column.

    The longer one must be a strip that points at the other, which is about as wide.
    """
    long, short = sorted((_strip(view, a), _strip(view, b)), key=lambda s: -s.length)
    link = short.centre - long.centre
    distance = float(np.linalg.norm(link))
    straight = abs(link @ long.axis) > ALIGNED * distance
    gap = distance - 0.5 * (long.length + short.length)
    widths = sorted((long.width, short.width))
    return bool(
        long.width < THIN * long.length
        and straight
        and widths[1] < SAME_WIDTH * widths[0]
        and gap < MAX_GAP * long.length
    )


@dataclass(frozen=True)
class _Strip:
    """A region as a bar, in pixels of the work grid."""

    centre: np.ndarray
    axis: np.ndarray
    length: float
    width: float


def _strip(view: ViewBlobs, index: int) -> _Strip:
    blob = view.blobs[index]
    rows, columns = np.nonzero(blob.region)
    points = np.stack([columns + blob.left, rows + blob.top], axis=1).astype(float)
    centre = points.mean(axis=0)
    # 1/12 is the variance of one pixel, and 12 times the variance the square of a bar's length.
    covariance = (points - centre).T @ (points - centre) / len(points) + np.eye(2) / 12
    values, axes = np.linalg.eigh(covariance)
    width, length = np.sqrt(12 * values)
    return _Strip(centre, axes[:, 1], float(length), float(width))
