"""Random numbers of a room: one independent stream for each thing that is decided."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

T = TypeVar("T")
Rng = np.random.Generator


def stream(seed: int, label: str) -> Rng:
    """A generator for (seed, label): adding one decision never shifts the others."""
    sequence = np.random.SeedSequence([seed, zlib.crc32(label.encode())])
    return np.random.Generator(np.random.PCG64(sequence))


def pick(rng: Rng, options: Sequence[T], weights: Sequence[float] | None = None) -> T:
    """One of the options; weights need not add up to one."""
    if weights is None:
        return options[int(rng.integers(len(options)))]
    share = np.asarray(weights, float)
    return options[int(rng.choice(len(options), p=share / share.sum()))]


def between(rng: Rng, low: float | int, high: float | int) -> float:
    """Uniform in [low, high], rounded to 0.1 mm so that JSON stays short."""
    return round(float(rng.uniform(low, high)), 4)


def chance(rng: Rng, probability: float) -> bool:
    """True with this probability."""
    return bool(rng.random() < probability)
