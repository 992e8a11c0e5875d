"""Procedural rooms: furnished, lit, textured, from a seed alone; plain data without Blender."""

from luxcore.rooms.generate import generate_room
from luxcore.rooms.model import Lamp, Material, Opening, Part, Room

__all__ = ["Lamp", "Material", "Opening", "Part", "Room", "generate_room"]
