"""How well found lamps agree with the true ones: matched by overlap, one to one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from luxcore.masks.store import Mask

LampViews = Mapping[int, Mask]
"""Mask of one lamp by view."""


@dataclass(frozen=True)
class Agreement:
    """`recall`: true lamps found; `precision`: found lamps that are true; `iou` of the matched."""

    recall: float
    precision: float
    iou: float


def agreement(found: Sequence[LampViews], true: Sequence[LampViews]) -> Agreement:
    """Pair lamps greedily by overlap over all views; a pair counts when it overlaps at all.

    With no lamps on either side, what cannot be missed or wrong counts as right.
    """
    overlaps = sorted(
        ((overlap(f, t), -i, -j) for i, f in enumerate(found) for j, t in enumerate(true)),
        reverse=True,
    )
    matched: dict[int, float] = {}
    used: set[int] = set()
    for iou, i, j in overlaps:
        if iou > 0 and i not in matched and j not in used:
            matched[i] = iou
            used.add(j)
    return Agreement(
        recall=len(used) / len(true) if true else 1.0,
        precision=len(matched) / len(found) if found else 1.0,
        iou=float(np.mean(list(matched.values()))) if matched else 0.0,
    )


def overlap(a: LampViews, b: LampViews) -> float:
    """Intersection over union of two lamps, summed over the views of both."""
    views = set(a) & set(b)
    both = sum(int((a[v] & b[v]).sum()) for v in views)
    either = sum(int(m.sum()) for m in [*a.values(), *b.values()]) - both
    return both / either if either else 0.0
