"""Tetrahedral interpolation of a colour table, the way OpenColorIO does it. numpy and torch."""

from __future__ import annotations

from typing import Any

import numpy as np

from luxcore.light.arrays import Array, as_index, constant, namespace, take_along


class Tetrahedra:
    """The tetrahedron around each position of a cubic lattice: its corners and their weights.

    A cube is cut along its diagonal; the corner path follows the channels from the one with the
    largest fraction to the one with the smallest, so sorting the fractions finds the tetrahedron.
    `position` is [..., 3] in cells from the first node; `table` is [size³, 3], first channel the
    slowest axis.
    """

    def __init__(self, position: Array, table: np.ndarray) -> None:
        xp = namespace(position)
        size = round(len(table) ** (1 / 3))
        base = xp.clip(xp.floor(position), 0, size - 2)
        fraction = position - base
        self.order = xp.argsort(-fraction, -1)
        self.fraction = take_along(fraction, self.order)
        strides = as_index(constant(position, np.array([size**2, size, 1])))
        first = (as_index(base) * strides).sum(-1)
        steps = strides[self.order]
        nodes = [
            first,
            first + steps[..., 0],
            first + steps[..., :2].sum(-1),
            first + (size**2 + size + 1),
        ]
        values = constant(position, table)
        self.corners: list = [values[node] for node in nodes]

    def edges(self) -> list:
        """Three [..., 3] differences of successive corners: the slope along each channel."""
        return [b - a for a, b in zip(self.corners[:-1], self.corners[1:], strict=True)]

    def value(self) -> Any:
        """[..., 3] interpolated values."""
        total = self.corners[0]
        for axis, edge in enumerate(self.edges()):
            total = total + self.fraction[..., axis : axis + 1] * edge
        return total

    def solve(self, residual: Array) -> Array:
        """[..., 3] step of the position that adds `residual` to the value; 0 where degenerate."""
        xp = namespace(residual)
        a, b, c = self.edges()
        normal = xp.cross(b, c, axis=-1)
        volume = (a * normal).sum(-1)
        usable = xp.abs(volume) > 1e-12
        # Cramer's rule, edge by edge.
        numerators = [normal, xp.cross(c, a, axis=-1), xp.cross(a, b, axis=-1)]
        steps = xp.stack([(residual * n).sum(-1) for n in numerators], axis=-1)
        steps = steps / xp.where(usable, volume, xp.ones_like(volume))[..., None]
        steps = xp.where(usable[..., None], steps, xp.zeros_like(steps))
        return take_along(steps, xp.argsort(self.order, -1))
