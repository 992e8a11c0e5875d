"""Random numbers that follow from a seed and the name of what they are for."""

from __future__ import annotations

import torch
from numpy.random import PCG64, Generator, SeedSequence


def numpy_generator(*entropy: int) -> Generator:
    """A generator of its own for each tuple of non-negative numbers."""
    return Generator(PCG64(SeedSequence(entropy)))


def torch_generator(*entropy: int) -> torch.Generator:
    """The same for torch, on the CPU: the same noise whatever device it is used on."""
    state = SeedSequence(entropy).generate_state(2, "uint32")
    return torch.Generator().manual_seed(int(state[0]) << 31 ^ int(state[1]))
