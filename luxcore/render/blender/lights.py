"""Which lights burn: a top-up render switches all but one lamp off without moving anything."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy

from luxcore.render.blender.materials import matt_material

LAMP_PROPERTY = "lux_lamp"
"""Custom property of an object that gives light: the index of its lamp, or OUTSIDE."""

OUTSIDE = -1
"""In place of a lamp's index: the environment and its portals."""


@contextmanager
def only_lamp(scene: Any, lamp: int) -> Iterator[None]:
    """Inside, only this lamp (or OUTSIDE) gives light; the others still cast their shadows."""
    swapped, hidden = [], []
    matt = matt_material("unlit")
    for holder in scene.objects:
        if holder.get(LAMP_PROPERTY, lamp) == lamp:
            continue
        if holder.type == "LIGHT":
            holder.hide_render = True
            hidden.append(holder)
        else:
            swapped.append((holder.data, holder.data.materials[0]))
            holder.data.materials[0] = matt
    background = scene.world.node_tree.nodes["Background"].inputs["Strength"]
    daylight = background.default_value
    if lamp != OUTSIDE:
        background.default_value = 0.0
    try:
        yield
    finally:
        background.default_value = daylight
        for data, material in swapped:
            data.materials[0] = material
        for holder in hidden:
            holder.hide_render = False
        bpy.data.materials.remove(matt)
