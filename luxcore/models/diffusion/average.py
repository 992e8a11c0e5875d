"""The running average of what is trained: smoother than any single step, and what is exported."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import torch
from torch import Tensor


class RunningAverage:
    """Exponential moving average of named parameters, float32.

    The decay warms up as (1 + step) / (10 + step), so that the first steps do not weigh on it for
    ever. Only trained parameters are averaged: a frozen base has no second copy.
    """

    def __init__(self, parameters: Mapping[str, Tensor], decay: float) -> None:
        self.decay = decay
        self.values = {name: p.detach().float().clone() for name, p in parameters.items()}

    @torch.no_grad()
    def update(self, parameters: Mapping[str, Tensor], step: int) -> None:
        """Move towards `parameters` as they are after `step` (1 is the first)."""
        weight = 1 - min(self.decay, (1 + step) / (10 + step))
        for name, value in self.values.items():
            value.lerp_(parameters[name].detach().float(), weight)

    @contextmanager
    def in_place_of(self, parameters: Mapping[str, Tensor]) -> Iterator[None]:
        """Within the block `parameters` hold the average; afterwards their own values again."""
        own = {name: p.detach().clone() for name, p in parameters.items()}
        _copy(self.values, parameters)
        try:
            yield
        finally:
            _copy(own, parameters)


@torch.no_grad()
def _copy(source: Mapping[str, Tensor], target: Mapping[str, Tensor]) -> None:
    for name, value in source.items():
        target[name].copy_(value)
