"""Rooms to light-group images through Blender Cycles, in a process of its own."""

from luxcore.render.unit import render_unit, render_view
from luxcore.render.views import PanoramaView, View

__all__ = ["PanoramaView", "View", "render_unit", "render_view"]
