"""Run in Blender's process: `python make_scenes.py FOLDER` writes the scenes that tests import."""

from __future__ import annotations

import argparse
from pathlib import Path

import bpy


def _empty() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)


def _light(name: str, kind: str, energy: float, color: tuple, at: tuple, **more: object) -> None:
    light = bpy.data.lights.new(name, kind)
    light.energy, light.color = energy, color
    for key, value in more.items():
        setattr(light, key, value)
    holder = bpy.data.objects.new(name, light)
    holder.location = at
    bpy.context.scene.collection.objects.link(holder)


def _room() -> None:
    bpy.ops.mesh.primitive_cube_add(size=1, location=(0, 0, 1.25), scale=(4, 3, 2.5))


def lights(folder: Path) -> None:
    """A room with a point, a spot and an area light, as .blend, glTF and USD."""
    _empty()
    _room()
    _light("bulb", "POINT", 60.0, (1.0, 0.5, 0.25), (1.0, 0.0, 2.0))
    _light("beam", "SPOT", 40.0, (0.0, 1.0, 0.0), (-1.0, 0.5, 2.2), spot_size=1.0)
    for name, form in (("lights.gltf", "GLTF_SEPARATE"), ("lights.glb", "GLB")):
        path = str(folder / name)
        bpy.ops.export_scene.gltf(filepath=path, export_format=form, export_lights=True)
    _light("panel", "AREA", 100.0, (1.0, 1.0, 1.0), (0.0, -1.0, 2.4), size=0.5)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "lights.blend"))
    bpy.ops.wm.usd_export(filepath=str(folder / "lights.usda"), export_lights=True)


def glowing(folder: Path) -> None:
    """Five emitting balls of a chandelier under one parent, and one of another colour apart."""
    _empty()
    _room()
    parent = bpy.data.objects.new("chandelier", None)
    bpy.context.scene.collection.objects.link(parent)
    for number in range(6):
        material = bpy.data.materials.new(f"glow{number}")
        material.use_nodes = True
        shader = material.node_tree.nodes["Principled BSDF"]
        shader.inputs["Emission Color"].default_value = (1, 0.8, 0.6, 1) if number else (0, 0, 1, 1)
        shader.inputs["Emission Strength"].default_value = 10.0
        at = (0.5 * number - 1.0, 0.0, 2.0) if number else (0.0, 1.2, 1.0)
        bpy.ops.mesh.primitive_uv_sphere_add(radius=0.05, location=at, segments=64, ring_count=32)
        bpy.context.object.data.materials.append(material)
        bpy.context.object.parent = parent if number else None
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "glowing.blend"))


def hostile(folder: Path) -> None:
    """A file that wants to run a script and a driver, and one that links a file elsewhere."""
    _empty()
    _room()
    _light("bulb", "POINT", 60.0, (1, 1, 1), (0, 0, 2))
    text = bpy.data.texts.new("autorun.py")
    text.write(f"open({str(folder / 'script-ran')!r}, 'w').close()\n")
    text.use_module = True
    driver = bpy.data.objects["bulb"].driver_add("location", 0).driver
    driver.type = "SCRIPTED"
    driver.expression = f"(open({str(folder / 'driver-ran')!r}, 'w').close(), 1.0)[1]"
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "script.blend"))
    (folder / "inner").mkdir()
    _empty()
    with bpy.data.libraries.load(str(folder / "lights.blend"), link=True) as (source, target):
        target.objects = list(source.objects)
    for linked in target.objects:
        bpy.context.scene.collection.objects.link(linked)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "inner" / "linked.blend"))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    out = parser.parse_args().folder
    lights(out)
    glowing(out)
    hostile(out)
