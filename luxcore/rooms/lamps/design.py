"""What a lamp design returns, and the parts that many of them share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from luxcore.rooms.dice import Rng
from luxcore.rooms.model import Part
from luxcore.rooms.palette import Palette
from luxcore.rooms.shapes import Lathe, Shape, Vec3, disc

WHITE_GLASS = "white_metal"
"""The unlit look of what emits; while a part emits, its material is not used."""


@dataclass(frozen=True)
class Beam:
    """A spot of a design, in the lamp's frame: share of the power, full cone in degrees."""

    position: Vec3
    direction: Vec3
    cone_deg: float
    blend: float
    radius_m: float
    emits: float


@dataclass(frozen=True)
class LampPiece:
    """A lamp in its own frame: ceiling lamps hang from the origin down, wall lamps face +y from
    it, floor and table lamps stand on it."""

    design: str
    parts: tuple[Part, ...]
    beams: tuple[Beam, ...]
    height: float
    """Extent along z, metres."""
    radius: float
    """Half of the footprint."""


Design = Callable[[Rng, Palette], LampPiece]


def solid(
    name: str, shape: Shape, material: str, at: Vec3 = (0.0, 0.0, 0.0), turn: Vec3 = (0.0, 0.0, 0.0)
) -> Part:
    """A part of the fixture that gives no light."""
    return Part(name, shape, material, at, turn, lamp=0, smooth=True)


def glow(
    name: str, shape: Shape, share: float, at: Vec3 = (0.0, 0.0, 0.0), turn: Vec3 = (0.0, 0.0, 0.0)
) -> Part:
    """A part whose front gives `share` of the lamp's light."""
    return Part(name, shape, WHITE_GLASS, at, turn, lamp=0, emits=round(share, 5), smooth=True)


def shade(
    base: float,
    top: float,
    low: float,
    high: float,
    side: float,
    down: float,
    up: float,
    segments: int = 28,
) -> list[Part]:
    """A cloth shade as the emitter: a glowing side, and discs for what leaves below and above.

    `base`, `top`: radii; `low`, `high`: heights; the three shares of the power.
    """
    parts = [glow("shade", Lathe(((base, low), (top, high)), segments), side)]
    if down > 0:
        parts.append(glow("mouth", disc(base * 0.96, low + 0.004, up=False), down))
    if up > 0:
        parts.append(glow("mouth", disc(top * 0.96, high - 0.004, up=True), up))
    return parts


def hood(
    profile: tuple[tuple[float, float], ...],
    material: str,
    mouth_z: float,
    mouth_radius: float,
    share: float = 1.0,
) -> list[Part]:
    """An opaque hood whose mouth glows downward: a cone of light."""
    return [
        solid("hood", Lathe(profile, 28), material),
        glow("mouth", disc(mouth_radius, mouth_z, up=False), share),
    ]
