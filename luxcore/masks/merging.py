"""A lamp that something in front of it splits into pieces is still one lamp."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from luxcore.masks.grouping import Group, ViewBlobs, extent, project

REACH = 0.8
"""Two pieces belong together when their centres are closer than this times both extents."""

PIECE_SCORE = 3.5
"""A piece may be less lamp-like than a whole lamp, but not less than this."""


def merge_pieces(groups: Sequence[Group], views: Sequence[ViewBlobs]) -> list[Group]:
    """Join groups whose extents meet in space and that never show between them a gap in all views.

    The order stays that of the first piece.
    """
    merged: list[Group] = []
    for group in groups:
        size = extent(group, views)
        partner = next((m for m in merged if _one_lamp(m, group, size, views)), None)
        if partner is None:
            merged.append(group)
            continue
        for view, members in group.members.items():
            partner.members.setdefault(view, []).extend(members)
    return merged


def add_pieces(groups: Sequence[Group], views: Sequence[ViewBlobs]) -> None:
    """Give each lamp the free regions that lie within its extent, in every view."""
    taken = {(v, i) for g in groups for v, members in g.members.items() for i in members}
    for group in groups:
        size = extent(group, views)
        for index, view in enumerate(views):
            centre, depth = project(view.camera, group.place[None])
            if depth[0] <= 0 or index not in group.members:
                continue
            radius = size * view.camera.fx / depth[0]
            for number, blob in enumerate(view.blobs):
                place = np.array(blob.centre) * (view.camera.width, view.camera.height)
                near = np.linalg.norm(place - centre[0]) < radius
                free = (index, number) not in taken
                if near and free and view.scores[number] >= PIECE_SCORE:
                    group.members[index].append(number)
                    taken.add((index, number))


def _one_lamp(a: Group, b: Group, b_size: float, views: Sequence[ViewBlobs]) -> bool:
    distance = float(np.linalg.norm(a.place - b.place))
    return distance < REACH * (extent(a, views) + b_size)
