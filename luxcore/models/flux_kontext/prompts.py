"""The instructions of the single-view model (paper, supplement, "Models"): a closed set."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from itertools import product


class LightKind(StrEnum):
    """What the instruction calls the lamp; LIGHT where its kind is not known."""

    LIGHT = "light"
    CEILING = "ceiling light"
    WALL = "wall light"
    FLOOR = "floor lamp"
    TABLE = "table lamp"


KIND_NAMES = {
    "ceiling": LightKind.CEILING,
    "wall": LightKind.WALL,
    "floor": LightKind.FLOOR,
    "table": LightKind.TABLE,
    "desk": LightKind.TABLE,
}
"""Kinds as rendered rooms and the public dataset call them, in lower case."""


def kind_named(name: str) -> LightKind:
    """The kind of a lamp by a dataset's name for it; LIGHT for signs and unknown ones."""
    return KIND_NAMES.get(name.lower(), LightKind.LIGHT)


class Brightness(StrEnum):
    """The brightness that an OLAT is asked for; one per bracket."""

    HIGH = "high"
    MEDIUM = "medium"
    LOW = "low"

    @property
    def exposure_ev(self) -> float:
        """EV relative to the tone-mapped HDR target: 0, -2, -4."""
        return {Brightness.HIGH: 0.0, Brightness.MEDIUM: -2.0, Brightness.LOW: -4.0}[self]


@dataclass(frozen=True)
class OlatPrompt:
    """One light at a time: everything off but the selected lamp."""

    kind: LightKind
    brightness: Brightness

    @property
    def text(self) -> str:
        return (
            "OLAT. Darken the room to a night scene: eliminate all light sources and window light. "
            f"The only light source should be the selected {self.kind}, on at {self.brightness} "
            "brightness, according to the selection mask."
        )


@dataclass(frozen=True)
class LightOffPrompt:
    """Only the selected lamp off."""

    kind: LightKind

    @property
    def text(self) -> str:
        return (
            f"LTOFF. Only turn off the selected {self.kind}, according to the selection mask. "
            "Keep the remaining light sources unchanged."
        )


Prompt = OlatPrompt | LightOffPrompt


def all_prompts() -> list[Prompt]:
    """Every instruction there is: four templates for each kind of lamp."""
    olat = [OlatPrompt(kind, brightness) for kind, brightness in product(LightKind, Brightness)]
    return [*olat, *(LightOffPrompt(kind) for kind in LightKind)]
