"""What a model must offer so that the training loop can train it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from torch import Tensor, nn
from torch.optim import Optimizer

from luxcore.models.diffusion.schedule import ExampleKey

Example = Mapping[str, Tensor]
"""One training example as CPU tensors, by name."""


@runtime_checkable
class Examples(Protocol):
    """Training examples by key: the same key, the same bits, in any process."""

    def __getitem__(self, key: ExampleKey) -> Example: ...


@runtime_checkable
class Trainee(Protocol):
    """A model that the loop can train."""

    @property
    def module(self) -> nn.Module:
        """Its forward takes the tensors of `batch` by name and returns a loss per example, [b]."""
        ...

    @property
    def examples(self) -> Examples: ...

    def optimizer(self, parameters: Sequence[nn.Parameter]) -> Optimizer: ...

    def batch(
        self, keys: Sequence[ExampleKey], examples: Sequence[Example], device: torch.device
    ) -> dict[str, Tensor]:
        """Encoded examples and their noise, on `device`; all randomness follows from `keys`."""
        ...

    def pictures(self) -> Mapping[str, np.ndarray]:
        """Validation pictures [h, w, 3] in 0..1, with the parameters as they are."""
        ...

    def export(self, folder: Path) -> None:
        """Write the parameters as they are into an existing folder, ready to be loaded."""
        ...
