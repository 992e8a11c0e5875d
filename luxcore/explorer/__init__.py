"""Lighting Blend Explorer: one photo's lamps, mixed in the browser by one self-contained page."""

from luxcore.explorer.page import write_explorer

__all__ = ["write_explorer"]
