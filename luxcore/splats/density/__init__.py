"""Density control: two strategies behind one interface."""

from luxcore.splats.density.mcmc import McmcSettings, McmcStrategy
from luxcore.splats.density.standard import StandardSettings, StandardStrategy
from luxcore.splats.density.strategy import Edit, Strategy

__all__ = [
    "Edit",
    "McmcSettings",
    "McmcStrategy",
    "StandardSettings",
    "StandardStrategy",
    "Strategy",
]
