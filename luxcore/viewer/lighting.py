"""What a person has chosen in the viewer, and the weight of every light that follows from it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from luxcore.light.levels import split_scale

Tone = Literal["AgX", "standard"]
AMBIENT = "ambient"
MAX_STOPS = 6.0
Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Row:
    """One light: a switch, a dimmer and a colour."""

    on: bool
    stops: float = 0.0
    """Relative to its level in the photos, -MAX_STOPS..MAX_STOPS."""
    colour: Colour | None = None
    """Linear RGB in 0..1; None is its own colour in the photos."""


@dataclass(frozen=True)
class Lighting:
    """All choices together; row 0 is the ambient light."""

    rows: tuple[Row, ...]
    solo: int | None = None
    """The only row that is lit, if any; switches keep their state meanwhile."""
    exposure_ev: float = 0.0
    tone: Tone = "AgX"

    def with_row(self, index: int, row: Row) -> Lighting:
        """A copy in which one row is another."""
        return replace(self, rows=(*self.rows[:index], row, *self.rows[index + 1 :]))


@dataclass(frozen=True)
class Lamps:
    """The lights of a scene as they were in the photos, ambient first."""

    names: tuple[str, ...]
    level: Float[np.ndarray, " m"]
    colour: Float[np.ndarray, "m 3"]
    on: tuple[bool, ...]

    @staticmethod
    def from_scale(names: tuple[str, ...], scale: Float[np.ndarray, "k 3"]) -> Lamps:
        """Lamps from their linear RGB in the photos; the ambient light is put before them."""
        lamps = split_scale(scale)
        return Lamps(
            (AMBIENT, *names),
            np.concatenate([[1.0], lamps.level]),
            np.concatenate([np.ones((1, 3)), lamps.colour]),
            (True, *(bool(on) for on in lamps.on)),
        )

    def original(self) -> Lighting:
        """The lighting of the photos."""
        return Lighting(tuple(Row(on) for on in self.on))

    def weights(self, lighting: Lighting) -> Float[np.ndarray, "m 3"]:
        """Linear RGB factor of every light, float32; dark rows are 0."""
        weights = np.zeros((len(self.names), 3), np.float32)
        for i, row in enumerate(lighting.rows):
            if row.on if lighting.solo is None else lighting.solo == i:
                colour = self.colour[i] if row.colour is None else np.array(row.colour)
                weights[i] = self.level[i] * 2.0**row.stops * colour
        return weights
