"""What a person has chosen in the viewer, and the lamp settings that follow from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from luxcore.splats.light_views import AMBIENT
from luxcore.splats.relighting import LampSetting
from luxcore.splats.scene import Scene

Tone = Literal["AgX", "standard"]
MAX_STOPS = 6.0
Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Row:
    """One light: a switch, a dimmer and a colour."""

    on: bool
    stops: float = 0.0
    """Relative to its brightness in the photos, -MAX_STOPS..MAX_STOPS."""
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

    def lit(self, index: int) -> bool:
        """Whether a row gives light."""
        return self.rows[index].on if self.solo is None else self.solo == index


def light_names(scene: Scene) -> tuple[str, ...]:
    """Names of the rows: the ambient light, then the lamps."""
    return (AMBIENT, *(lamp.name for lamp in scene.lamps))


def original_lighting(scene: Scene) -> Lighting:
    """The lighting of the photos."""
    return Lighting((Row(True), *(Row(lamp.on) for lamp in scene.lamps)))


def lamp_settings(names: tuple[str, ...], lighting: Lighting) -> dict[str, LampSetting]:
    """What each light is asked to do; a dark row has intensity 0."""
    return {
        name: LampSetting(2.0**row.stops if lighting.lit(i) else 0.0, row.colour)
        for i, (name, row) in enumerate(zip(names, lighting.rows, strict=True))
    }
