"""Which examples a step sees, on which device: a pure function of the step."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from luxcore.errors import InputError
from luxcore.settings.paper_models import TrainingPhase


class ExampleKey(NamedTuple):
    """Names one training example for ever: its position in the run, and how many views it has."""

    position: int
    views: int


@dataclass(frozen=True)
class Plan:
    """The examples of every step of a run, split over `world` devices in micro-batches.

    Together the devices always see the same examples in a step, whatever their number.
    """

    phases: tuple[TrainingPhase, ...]
    micro_batch: int
    world: int = 1
    rank: int = 0

    def __post_init__(self) -> None:
        for phase in self.phases:
            if phase.batch_size % self.world:
                raise InputError(
                    f"a batch of {phase.batch_size} cannot be shared by {self.world} devices: "
                    "it must be a multiple of their number."
                )

    @property
    def steps(self) -> int:
        """Steps of all phases together."""
        return sum(phase.steps for phase in self.phases)

    def keys(self, step: int) -> list[ExampleKey]:
        """This device's examples of `step` (0 is the first)."""
        first = 0
        for phase in self.phases:
            if step < phase.steps:
                start = first + step * phase.batch_size
                positions = range(start + self.rank, start + phase.batch_size, self.world)
                return [ExampleKey(position, phase.views) for position in positions]
            step -= phase.steps
            first += phase.steps * phase.batch_size
        raise IndexError(f"the run has {self.steps} steps.")

    def micro_batches(self, step: int) -> list[Sequence[ExampleKey]]:
        """The same examples in groups that fit on the device."""
        keys = self.keys(step)
        return [keys[i : i + self.micro_batch] for i in range(0, len(keys), self.micro_batch)]

    def micro_batches_from(self, step: int) -> Iterator[list[ExampleKey]]:
        """Every micro-batch from `step` to the end, in order."""
        for later in range(step, self.steps):
            yield from (list(batch) for batch in self.micro_batches(later))
