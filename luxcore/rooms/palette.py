"""The materials of one room: tones that go together, drawn once and shared by its furniture."""

from __future__ import annotations

import colorsys
from dataclasses import dataclass, field

from luxcore.rooms.dice import Rng, between, chance, pick
from luxcore.rooms.model import Material, MaterialKind
from luxcore.rooms.shapes import Vec3

WOODS: tuple[tuple[Vec3, Vec3], ...] = (
    ((0.34, 0.19, 0.09), (0.44, 0.27, 0.14)),
    ((0.11, 0.055, 0.03), (0.17, 0.09, 0.05)),
    ((0.5, 0.36, 0.22), (0.6, 0.46, 0.31)),
    ((0.23, 0.11, 0.05), (0.32, 0.17, 0.08)),
    ((0.42, 0.36, 0.29), (0.5, 0.44, 0.37)),
    ((0.68, 0.64, 0.58), (0.74, 0.7, 0.64)),
)


@dataclass
class Palette:
    """Named materials of a room; furniture asks for one by role and gets its name."""

    rng: Rng
    materials: dict[str, Material] = field(default_factory=dict)

    def add(self, name: str, material: Material) -> str:
        """Keep a material under a name (the first one given stays) and return the name."""
        self.materials.setdefault(name, material)
        return name

    def new(
        self,
        kind: MaterialKind,
        color: Vec3,
        color2: Vec3 | None = None,
        roughness: float = 0.6,
        scale: float = 0.1,
    ) -> str:
        """A material of its own, named by its number."""
        seed = int(self.rng.integers(1, 10_000))
        other = color if color2 is None else color2
        name = f"{kind}_{len(self.materials):02d}"
        return self.add(name, Material(kind, color, other, roughness, scale, seed))

    def wood(self) -> str:
        """One of the room's two woods."""
        return pick(self.rng, ("wood_a", "wood_b"))

    def fabric(self) -> str:
        """A fabric: the sofa's tone, an accent, or a new one."""
        if chance(self.rng, 0.6):
            return pick(self.rng, ("fabric_a", "fabric_b"))
        color = tone(self.rng, (0.1, 0.6), (0.15, 0.7))
        return self.new("fabric", color, lighter(color, 1.35), scale=between(self.rng, 0.02, 0.1))

    def metal(self) -> str:
        """Brass, steel, black or white metal."""
        return pick(self.rng, ("brass", "steel", "black", "white_metal"), (0.25, 0.3, 0.3, 0.15))

    def accent(self) -> Vec3:
        """A saturated colour for small things."""
        return tone(self.rng, (0.4, 0.9), (0.2, 0.8))


def tone(rng: Rng, saturation: tuple[float, float], value: tuple[float, float]) -> Vec3:
    """A random hue, in linear light."""
    hue = float(rng.random())
    rgb = colorsys.hsv_to_rgb(hue, between(rng, *saturation), between(rng, *value))
    r, g, b = (round(c**2.2, 4) for c in rgb)
    return (r, g, b)


def lighter(color: Vec3, factor: float) -> Vec3:
    """Scaled, within 0..0.9."""
    r, g, b = (round(min(0.9, c * factor), 4) for c in color)
    return (r, g, b)


def draw_palette(rng: Rng, use: str) -> Palette:
    """Walls, floor, ceiling, woods, fabrics, metals of one room."""
    palette = Palette(rng)
    add = palette.add
    seed = int(rng.integers(1, 10_000))
    add("ceiling", Material("paint", (0.8, 0.79, 0.77), roughness=0.9, seed=seed))
    _walls(palette, use, seed)
    _floor(palette, use, seed)
    for name in ("wood_a", "wood_b"):
        color, color2 = pick(rng, WOODS)
        add(
            name,
            Material(
                "wood", color, color2, between(rng, 0.3, 0.6), seed=int(rng.integers(1, 10_000))
            ),
        )
    for name in ("fabric_a", "fabric_b"):
        color = tone(rng, (0.05, 0.7), (0.2, 0.85))
        add(
            name,
            Material(
                "fabric",
                color,
                lighter(color, 1.4),
                0.95,
                between(rng, 0.015, 0.08),
                int(rng.integers(1, 10_000)),
            ),
        )
    add("brass", Material("metal", (0.78, 0.56, 0.25), roughness=between(rng, 0.2, 0.4)))
    add("steel", Material("metal", (0.6, 0.6, 0.61), roughness=between(rng, 0.2, 0.45)))
    add("black", Material("ceramic", (0.015, 0.015, 0.016), roughness=0.4))
    add("white_metal", Material("ceramic", (0.75, 0.75, 0.73), roughness=0.35))
    add(
        "trim",
        Material(
            "ceramic",
            pick(
                rng, ((0.78, 0.77, 0.74), (0.7, 0.66, 0.58), (0.09, 0.09, 0.1), (0.3, 0.17, 0.08))
            ),
            roughness=0.4,
        ),
    )
    add("leaf", Material("leaf", (0.04, 0.13, 0.03), (0.1, 0.26, 0.05), seed=seed))
    return palette


def _walls(palette: Palette, use: str, seed: int) -> None:
    rng = palette.rng
    main = lighter(tone(rng, (0.0, 0.2), (0.66, 0.96)), 1.0)
    palette.add("wall", Material("paint", main, roughness=0.85, seed=seed))
    kinds: tuple[MaterialKind, ...] = ("paint", "stripes", "damask", "brick", "paint")
    kind = pick(rng, kinds, (0.35, 0.2, 0.2, 0.15, 0.1))
    feature = tone(rng, (0.1, 0.6), (0.3, 0.8))
    if kind == "brick":
        feature = pick(rng, ((0.32, 0.12, 0.07), (0.6, 0.57, 0.52), (0.4, 0.2, 0.13)))
    palette.add(
        "wall_feature",
        Material(
            kind,
            feature,
            lighter(feature, 1.6),
            0.8,
            between(rng, 0.07, 0.14) if kind == "brick" else between(rng, 0.06, 0.3),
            seed,
        ),
    )


def _floor(palette: Palette, use: str, seed: int) -> None:
    rng = palette.rng
    wet = use in ("kitchen", "corridor")
    kind = pick(rng, ("planks", "tile", "carpet"), (0.45, 0.5, 0.05) if wet else (0.65, 0.12, 0.23))
    if kind == "planks":
        color, color2 = pick(rng, WOODS)
        material = Material(
            "planks", color, color2, between(rng, 0.25, 0.55), between(rng, 0.09, 0.2), seed
        )
    elif kind == "tile":
        color = pick(
            rng, ((0.6, 0.58, 0.54), (0.35, 0.34, 0.33), (0.5, 0.33, 0.22), (0.72, 0.7, 0.66))
        )
        material = Material(
            "tile",
            color,
            lighter(color, 0.55),
            between(rng, 0.15, 0.4),
            between(rng, 0.25, 0.6),
            seed,
        )
    else:
        material = Material("carpet", tone(rng, (0.05, 0.35), (0.4, 0.75)), seed=seed)
    palette.add("floor", material)
