"""Each kind of `luxcore.rooms.model.Material` as procedural Cycles nodes (no image files)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, get_args

import bpy

from luxcore.render.blender.nodes import Graph
from luxcore.rooms.model import Material, MaterialKind
from luxcore.rooms.shapes import Vec3


def build_material(name: str, material: Material) -> Any:
    """A Blender material for the recipe; the same recipe gives the same nodes."""
    built = bpy.data.materials.new(name)
    graph = Graph(built)
    graph.surface(RECIPES[material.kind](graph, material))
    return built


UNLIT_REFLECTANCE = 0.65
"""Cloth, paper and milk glass of a lamp that is off still return the light of the others."""


def emitter_material(name: str, radiance: float) -> Any:
    """White light of `radiance` (W/sr/m²) from the front of a surface, which is also matt white."""
    built = bpy.data.materials.new(name)
    built.cycles.emission_sampling = "FRONT"
    graph = Graph(built)
    facing = graph.tree.nodes.new("ShaderNodeNewGeometry")
    front = graph.node("Math", {"operation": "SUBTRACT"})
    graph.set(front.inputs[0], 1.0)
    graph.set(front.inputs[1], facing.outputs["Backfacing"])
    power = graph.node("Math", {"operation": "MULTIPLY"})
    graph.set(power.inputs[0], front.outputs[0])
    graph.set(power.inputs[1], radiance)
    light = graph.node("Emission", Color=(1.0, 1.0, 1.0), Strength=power.outputs[0])
    matt = graph.matt((UNLIT_REFLECTANCE,) * 3)
    both = graph.tree.nodes.new("ShaderNodeAddShader")
    graph.set(both.inputs[0], light.outputs[0])
    graph.set(both.inputs[1], matt.outputs[0])
    graph.surface(both)
    return built


def matt_material(name: str) -> Any:
    """What an emitter looks like while its lamp is off."""
    built = bpy.data.materials.new(name)
    graph = Graph(built)
    graph.surface(graph.matt((UNLIT_REFLECTANCE,) * 3))
    return built


def _offset(m: Material) -> float:
    return (m.seed % 997) * 0.37


def _noise(graph: Graph, vector: Any, scale: float, detail: float = 2.0) -> Any:
    return graph.node("TexNoise", Vector=vector, Scale=scale, Detail=detail).outputs[0]


def _shade(color: Vec3, factor: float) -> Vec3:
    r, g, b = (min(1.0, c * factor) for c in color)
    return (r, g, b)


def _paint(graph: Graph, m: Material) -> Any:
    vector = graph.coordinates((1.0, 1.0, 1.0), _offset(m))
    stains = _noise(graph, vector, 3.0, 2.0)
    color = graph.ramp(stains, (0.3, _shade(m.color, 0.97)), (0.7, _shade(m.color, 1.02)))
    return graph.matt(color)


def _stripes(graph: Graph, m: Material) -> Any:
    vector = graph.coordinates((m.scale, m.scale, m.scale), _offset(m))
    wave = graph.node(
        "TexWave",
        {"bands_direction": "X"},
        Vector=graph.swap_to_wall(vector),
        Scale=0.3,
        Distortion=0.0,
    )
    color = graph.ramp(wave.outputs["Fac"], (0.45, m.color), (0.55, m.color2))
    return graph.matt(color)


def _damask(graph: Graph, m: Material) -> Any:
    vector = graph.coordinates((m.scale, m.scale, m.scale), _offset(m))
    cells = graph.node("TexVoronoi", Vector=graph.swap_to_wall(vector), Scale=1.0, Randomness=0.35)
    color = graph.ramp(cells.outputs["Distance"], (0.28, m.color2), (0.34, m.color))
    return graph.matt(color)


def _grain(graph: Graph, m: Material, vector: Any) -> Any:
    noise = _noise(graph, vector, 2.0, 5.0)
    return graph.ramp(noise, (0.25, _shade(m.color, 0.55)), (0.5, m.color), (0.75, m.color2))


def _planks(graph: Graph, m: Material) -> Any:
    vector = graph.coordinates((1.0, 1.0, 1.0), 0.0)
    brick = graph.node(
        "TexBrick",
        {"offset": 0.37},
        Vector=vector,
        Scale=1.0,
        Color1=m.color,
        Color2=_shade(m.color, 0.62),
        Mortar=_shade(m.color, 0.2),
        Mortar_Size=0.0025,
        Brick_Width=m.scale * 8,
        Row_Height=m.scale,
        Bias=-0.1,
    )
    grain = _grain(graph, m, graph.coordinates((1.2, 0.09, 0.09), _offset(m)))
    return graph.principled(graph.mix(0.5, brick.outputs["Color"], grain), m.roughness)


def _tile(graph: Graph, m: Material) -> Any:
    vector = graph.coordinates((1.0, 1.0, 1.0), 0.0)
    brick = graph.node(
        "TexBrick",
        {"offset": 0.0},
        Vector=vector,
        Scale=1.0,
        Color1=m.color,
        Color2=_shade(m.color, 0.88),
        Mortar=m.color2,
        Mortar_Size=0.006,
        Brick_Width=m.scale,
        Row_Height=m.scale,
    )
    return graph.principled(brick.outputs["Color"], m.roughness)


def _brick(graph: Graph, m: Material) -> Any:
    vector = graph.swap_to_wall(graph.coordinates((1.0, 1.0, 1.0), 0.0))
    brick = graph.node(
        "TexBrick",
        Vector=vector,
        Scale=1.0,
        Color1=m.color,
        Color2=_shade(m.color, 0.7),
        Mortar=m.color2,
        Mortar_Size=0.012,
        Brick_Width=m.scale * 3,
        Row_Height=m.scale,
    )
    return graph.principled(brick.outputs["Color"], m.roughness)


def _carpet(graph: Graph, m: Material) -> Any:
    vector = graph.coordinates((1.0, 1.0, 1.0), _offset(m))
    pile = _noise(graph, vector, 90.0, 3.0)
    color = graph.ramp(pile, (0.3, _shade(m.color, 0.6)), (0.7, m.color))
    return graph.matt(color)


def _rug(graph: Graph, m: Material) -> Any:
    vector = graph.coordinates((m.scale, m.scale, m.scale), 0.0)
    cells = graph.node(
        "TexVoronoi",
        {"distance": "MANHATTAN"},
        Vector=vector,
        Scale=1.0,
        Randomness=0.15 + (m.seed % 5) * 0.15,
    )
    pattern = graph.ramp(
        cells.outputs["Distance"],
        (0.2, m.color2),
        (0.34, m.color),
        (0.5, _shade(m.color2, 0.5)),
        (0.6, m.color),
    )
    pile = _noise(graph, vector, 40.0, 2.0)
    color = graph.mix(0.25, pattern, graph.ramp(pile, (0.3, (0.02, 0.02, 0.02)), (0.7, m.color)))
    return graph.matt(color)


def _fabric(graph: Graph, m: Material) -> Any:
    vector = graph.coordinates((m.scale, m.scale, m.scale), _offset(m))
    weave = _noise(graph, vector, 8.0, 3.0)
    color = graph.ramp(weave, (0.3, _shade(m.color, 0.7)), (0.5, m.color), (0.72, m.color2))
    return graph.matt(color)


def _wood(graph: Graph, m: Material) -> Any:
    stretch = (0.8, 0.07, 0.07) if m.seed % 2 else (0.07, 0.07, 0.8)
    return graph.principled(_grain(graph, m, graph.coordinates(stretch, _offset(m))), m.roughness)


def _metal(graph: Graph, m: Material) -> Any:
    return graph.principled(m.color, m.roughness, Metallic=1.0)


def _ceramic(graph: Graph, m: Material) -> Any:
    return graph.principled(m.color, m.roughness, Specular_IOR_Level=0.5)


def _glass(graph: Graph, m: Material) -> Any:
    return graph.node("BsdfGlass", Color=m.color, Roughness=0.0, IOR=1.45)


def _pane(graph: Graph, m: Material) -> Any:
    """Thin glass: straight through but for a little reflection, so light needs no caustics."""
    clear = graph.node("BsdfTransparent", Color=m.color)
    gloss = graph.node("BsdfGlossy", Color=(1.0, 1.0, 1.0), Roughness=0.0)
    mixed = graph.tree.nodes.new("ShaderNodeMixShader")
    mixed.inputs[0].default_value = 0.06
    graph.set(mixed.inputs[1], clear.outputs[0])
    graph.set(mixed.inputs[2], gloss.outputs[0])
    return mixed


def _mirror(graph: Graph, m: Material) -> Any:
    return graph.node("BsdfGlossy", Color=m.color, Roughness=0.0)


def _leaf(graph: Graph, m: Material) -> Any:
    vector = graph.coordinates((1.0, 1.0, 1.0), _offset(m))
    color = graph.ramp(_noise(graph, vector, 14.0), (0.3, m.color), (0.7, m.color2))
    return graph.principled(color, 0.5)


def _picture(graph: Graph, m: Material) -> Any:
    """An abstract painting: three families, chosen by the seed."""
    vector = graph.coordinates((m.scale, m.scale, m.scale), _offset(m))
    family = m.seed % 3
    if family == 0:
        fac = graph.node("TexVoronoi", {"distance": "CHEBYCHEV"}, Vector=vector, Scale=2.2)
        factor = fac.outputs["Color"]
    elif family == 1:
        fac = graph.node("TexWave", Vector=vector, Scale=0.6, Distortion=9.0, Detail=3.0)
        factor = fac.outputs["Fac"]
    else:
        factor = _noise(graph, vector, 1.6, 6.0)
    third = (m.color[2], m.color[0], m.color2[1])
    color = graph.ramp(
        factor, (0.25, m.color), (0.42, m.color2), (0.55, third), (0.7, (0.8, 0.77, 0.7))
    )
    return graph.principled(color, 0.7)


def _stone(graph: Graph, m: Material) -> Any:
    vector = graph.coordinates((m.scale, m.scale, m.scale), _offset(m))
    veins = graph.node("TexWave", Vector=vector, Scale=0.5, Distortion=12.0, Detail=4.0)
    color = graph.ramp(veins.outputs["Fac"], (0.04, m.color2), (0.3, m.color))
    return graph.principled(color, m.roughness)


def _paper(graph: Graph, m: Material) -> Any:
    return graph.matt(m.color)


def _screen(graph: Graph, m: Material) -> Any:
    return graph.principled(m.color, 0.12)


Recipe = Callable[[Graph, Material], Any]
RECIPES: dict[str, Recipe] = {kind: globals()[f"_{kind}"] for kind in get_args(MaterialKind)}
