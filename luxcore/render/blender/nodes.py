"""A thin hand on Cycles' shader graphs: make a node, set its inputs, link by socket name."""

from __future__ import annotations

from typing import Any

import bpy


class Graph:
    """The node tree of one material, with its surface output."""

    def __init__(self, material: Any) -> None:
        self.tree = material.node_tree
        self.tree.nodes.clear()
        self._output = self.tree.nodes.new("ShaderNodeOutputMaterial")

    def node(self, kind: str, settings: dict[str, Any] | None = None, **inputs: Any) -> Any:
        """Add `ShaderNode{kind}`; inputs are values or sockets, underscores stand for spaces."""
        node = self.tree.nodes.new(f"ShaderNode{kind}")
        for name, value in (settings or {}).items():
            setattr(node, name, value)
        for name, value in inputs.items():
            self.set(node.inputs[name.replace("_", " ")], value)
        return node

    def set(self, socket: Any, value: Any) -> None:
        """Link a socket, or write a default value (colours may lack their alpha)."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        elif isinstance(value, tuple) and socket.type == "RGBA" and len(value) == 3:
            socket.default_value = (*value, 1.0)
        else:
            socket.default_value = value

    def surface(self, shader: Any) -> None:
        """Make this shader the surface."""
        self.tree.links.new(shader.outputs[0], self._output.inputs["Surface"])

    def ramp(self, factor: Any, *stops: tuple[float, tuple[float, float, float]]) -> Any:
        """A colour ramp through (position, colour) stops; returns its colour socket."""
        node = self.tree.nodes.new("ShaderNodeValToRGB")
        elements = node.color_ramp.elements
        while len(elements) < len(stops):
            elements.new(0.5)
        for element, (position, color) in zip(elements, stops, strict=True):
            element.position, element.color = position, (*color, 1.0)
        self.tree.links.new(factor, node.inputs["Fac"])
        return node.outputs["Color"]

    def mix(self, factor: Any, a: Any, b: Any) -> Any:
        """Linear mix of two colours; returns the colour socket."""
        node = self.tree.nodes.new("ShaderNodeMix")
        node.data_type = "RGBA"
        self.set(node.inputs[0], factor)
        self.set(node.inputs[6], a)
        self.set(node.inputs[7], b)
        return node.outputs[2]

    def coordinates(self, scale: tuple[float, float, float], offset: float) -> Any:
        """Object coordinates in metres, divided by `scale` (metres), moved by a seed's offset."""
        texture = self.tree.nodes.new("ShaderNodeTexCoord")
        mapping = self.node(
            "Mapping",
            Vector=texture.outputs["Object"],
            Scale=tuple(1.0 / s for s in scale),
            Location=(offset, offset * 1.7, offset * 0.6),
        )
        return mapping.outputs["Vector"]

    def swap_to_wall(self, vector: Any) -> Any:
        """(x, y, z) → (x + y, z, 0): a flat pattern for upright surfaces."""
        split = self.node("SeparateXYZ", Vector=vector)
        along = self.node("Math", {"operation": "ADD"})
        self.set(along.inputs[0], split.outputs["X"])
        self.set(along.inputs[1], split.outputs["Y"])
        joined = self.node("CombineXYZ", X=along.outputs[0], Y=split.outputs["Z"])
        return joined.outputs["Vector"]

    def principled(self, color: Any, roughness: Any, **inputs: Any) -> Any:
        """The Principled shader with a base colour and roughness."""
        return self.node("BsdfPrincipled", Base_Color=color, Roughness=roughness, **inputs)

    def matt(self, color: Any) -> Any:
        """A plain diffuse surface: a third of the cost of Principled where there is no sheen."""
        return self.node("BsdfDiffuse", Color=color)
