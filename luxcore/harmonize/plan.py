"""Which views go through the multi-view model together, and in which order.

A pass holds at most 15 views: the references, which are always in, and targets. The first passes
take what is nearest to a reference, later ones what is nearest to anything done; the done view that
drew a target in may come along as a second reference, so that light is handed on in a chain
(paper, supplement, Inference details).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from luxcore.errors import InputError
from luxcore.models.interface import MAX_VIEWS_PER_PASS


@dataclass(frozen=True)
class Pass:
    """One run of the model. `secondary` are done views that come along as further references."""

    targets: tuple[int, ...]
    references: tuple[int, ...]
    secondary: tuple[int, ...] = ()


@dataclass(frozen=True)
class PassPlan:
    """All passes in order; `disconnected` views share no direction, even through others, with any
    reference: they are decomposed all the same, but nothing holds them consistent."""

    passes: tuple[Pass, ...]
    disconnected: tuple[int, ...]


def plan_passes(
    distance: Float[np.ndarray, "n n"],
    linked: Bool[np.ndarray, "n n"],
    references: Sequence[int],
    *,
    max_views: int = MAX_VIEWS_PER_PASS,
    chain: bool = True,
) -> PassPlan:
    """Order all n views into passes; a pure function, ties go to the lower view number.

    Every view, references too, is a target exactly once: a reference knows only the lamps that it
    shows. Raises InputError when the references leave no room for a target.
    """
    count, fixed = len(distance), tuple(sorted(set(references)))
    if not fixed or fixed[-1] >= count or fixed[0] < 0:
        raise InputError(f"references must be among the {count} views, got {list(references)}.")
    if len(fixed) >= max_views:
        raise InputError(
            f"{len(fixed)} reference views leave no room in passes of {max_views} views."
        )
    reach = _reachable(linked, fixed)
    todo = set(range(count))
    done: set[int] = set()
    passes: list[Pass] = []
    while todo:
        chosen = _next_pass(distance, reach, fixed, done, todo, max_views, chain)
        passes.append(chosen)
        done.update(chosen.targets)
        todo.difference_update(chosen.targets)
    return PassPlan(tuple(passes), tuple(i for i in range(count) if not reach[i]))


def _next_pass(
    distance: np.ndarray,
    reach: np.ndarray,
    fixed: tuple[int, ...],
    done: set[int],
    todo: set[int],
    max_views: int,
    chain: bool,
) -> Pass:
    sources = sorted(done | set(fixed))
    nearest = {view: min(sources, key=lambda s: (distance[view, s], s)) for view in todo}
    order = sorted(todo, key=lambda v: (not reach[v], distance[v, nearest[v]], v))
    targets: list[int] = []
    secondary: list[int] = []
    room = max_views - len(fixed)
    for view in order:
        source = nearest[view]
        extra = chain and source not in fixed and source not in secondary
        if len(targets) + len(secondary) + 1 + extra > room:
            # A target without its chain link may still fit when nothing else was taken.
            if targets or len(secondary) + 1 > room:
                break
            extra = False
        targets.append(view)
        if extra:
            secondary.append(source)
    return Pass(tuple(targets), fixed, tuple(secondary))


def _reachable(linked: np.ndarray, references: tuple[int, ...]) -> np.ndarray:
    reach = np.zeros(len(linked), bool)
    reach[list(references)] = True
    while True:
        grown = reach | linked[reach].any(axis=0)
        if (grown == reach).all():
            return reach
        reach = grown
