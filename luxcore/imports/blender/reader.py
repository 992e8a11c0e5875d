"""Open scene files in Blender and describe what is in them as plain JSON and arrays."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np

MAX_VERTICES = 2_000_000
"""A scene with more is refused: a room of ours would not fit in memory."""


def read_scene(paths: list[Path], out: Path) -> dict[str, Any]:
    """Describe the scene of the files; meshes go to `out`.npz, the rest is returned.

    `links` are all files that the scene refers to, absolute; they are not judged here.
    """
    _open(paths)
    meshes: list[dict[str, Any]] = []
    arrays: dict[str, np.ndarray] = {}
    total = 0
    depsgraph = bpy.context.evaluated_depsgraph_get()
    for holder in sorted(bpy.context.scene.objects, key=lambda o: o.name):
        if holder.type not in {"MESH", "CURVE", "SURFACE", "META", "FONT"} or holder.hide_render:
            continue
        mesh = holder.evaluated_get(depsgraph).to_mesh()
        if mesh is None or not mesh.polygons:
            continue
        total += len(mesh.vertices)
        if total > MAX_VERTICES:
            raise ValueError(f"more than {MAX_VERTICES} vertices")
        arrays.update(_geometry(holder, mesh, f"m{len(meshes)}"))
        meshes.append(_mesh_facts(holder))
    np.savez(out, **arrays)
    holders = sorted(bpy.context.scene.objects, key=lambda o: o.name)
    return {
        "meshes": meshes,
        "lights": [_light(h) for h in holders if h.type == "LIGHT" and not h.hide_render],
        "cameras": [_camera(h) for h in holders if h.type == "CAMERA"],
        "links": sorted(_links()),
        "scale_length": float(bpy.context.scene.unit_settings.scale_length),
    }


def _open(paths: list[Path]) -> None:
    first = paths[0].suffix.lower()
    if first == ".blend":
        bpy.ops.wm.open_mainfile(filepath=str(paths[0]), load_ui=False, use_scripts=False)
        return
    bpy.ops.wm.read_factory_settings(use_empty=True)
    for path in paths:
        if first in {".gltf", ".glb"}:
            bpy.ops.import_scene.gltf(filepath=str(path))
        elif first == ".obj":
            bpy.ops.wm.obj_import(filepath=str(path))
        else:
            bpy.ops.wm.usd_import(filepath=str(path))
    bpy.context.view_layer.update()


def _geometry(holder: Any, mesh: Any, key: str) -> dict[str, np.ndarray]:
    vertices = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", vertices)
    matrix = np.array(holder.matrix_world)
    world = vertices.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
    sizes = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_total", sizes)
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    slots = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("material_index", slots)
    # A mirrored object turns its faces inside out.
    flipped = np.array(np.linalg.det(matrix[:3, :3]) < 0)
    parts = {"v": world, "n": sizes, "c": corners, "s": slots, "f": flipped}
    return {f"{key}{name}": value for name, value in parts.items()}


def _mesh_facts(holder: Any) -> dict[str, Any]:
    return {
        "name": holder.name,
        "parent": holder.parent.name if holder.parent else None,
        "materials": [_material(slot.material) for slot in holder.material_slots],
    }


def _material(material: Any) -> dict[str, Any]:
    """What the renderer of rooms can show of a material; textures become their mean colour."""
    facts: dict[str, Any] = {
        "name": material.name if material else "",
        "color": list(material.diffuse_color[:3]) if material else [0.8, 0.8, 0.8],
        "roughness": 0.5,
        "metallic": 0.0,
        "transmission": 0.0,
        "emission": [0.0, 0.0, 0.0],
    }
    for node in material.node_tree.nodes if material and material.node_tree else ():
        if node.type == "BSDF_PRINCIPLED":
            facts["color"] = _color(node.inputs["Base Color"])
            facts["roughness"] = float(node.inputs["Roughness"].default_value)
            facts["metallic"] = float(node.inputs["Metallic"].default_value)
            facts["transmission"] = float(node.inputs["Transmission Weight"].default_value)
            _add_emission(facts, node.inputs["Emission Color"], node.inputs["Emission Strength"])
        elif node.type == "BSDF_DIFFUSE":
            facts["color"] = _color(node.inputs["Color"])
        elif node.type == "EMISSION":
            _add_emission(facts, node.inputs["Color"], node.inputs["Strength"])
    return facts


def _add_emission(facts: dict[str, Any], color: Any, strength: Any) -> None:
    added = np.array(_color(color)) * float(strength.default_value)
    facts["emission"] = (np.array(facts["emission"]) + added).tolist()


def _color(socket: Any) -> list[float]:
    if socket.is_linked and socket.links[0].from_node.type == "TEX_IMAGE":
        image = socket.links[0].from_node.image
        if image is not None and image.has_data and image.size[0]:
            pixels = np.array(image.pixels[:], np.float32).reshape(-1, image.channels)
            # Blender hands out display values of 8-bit colour pictures.
            mean = (
                pixels[:, :3].astype(float) if image.channels >= 3 else pixels[:, :1].repeat(3, 1)
            )
            if image.colorspace_settings.name == "sRGB":
                low, high = mean / 12.92, ((mean + 0.055) / 1.055) ** 2.4
                mean = np.where(mean <= 0.04045, low, high)
            return mean.mean(axis=0).tolist()
    return list(socket.default_value[:3])


def _light(holder: Any) -> dict[str, Any]:
    light = holder.data
    color = np.array(light.color) * 2.0 ** float(light.exposure)
    if light.use_temperature:
        color = color * np.array(light.temperature_color)
    facts = {
        "name": holder.name,
        "parent": holder.parent.name if holder.parent else None,
        "type": light.type,
        "energy": float(light.energy),
        "color": color.tolist(),
        "matrix": np.array(holder.matrix_world).tolist(),
        "radius": float(getattr(light, "shadow_soft_size", 0.0)),
    }
    if light.type == "SPOT":
        facts["cone_deg"] = math.degrees(light.spot_size)
        facts["blend"] = float(light.spot_blend)
    if light.type == "AREA":
        square = light.shape in {"SQUARE", "DISK"}
        facts["round"] = light.shape in {"DISK", "ELLIPSE"}
        facts["size"] = [float(light.size), float(light.size if square else light.size_y)]
    return facts


def _camera(holder: Any) -> dict[str, Any]:
    camera = holder.data
    render = bpy.context.scene.render
    width, height = int(render.resolution_x), int(render.resolution_y)
    return {
        "name": holder.name,
        "matrix": np.array(holder.matrix_world).tolist(),
        "perspective": camera.type == "PERSP",
        # The angle is across the longer side unless the camera says otherwise.
        "angle": float(camera.angle),
        "fit": camera.sensor_fit,
        "size": [width, height],
        "shift": [float(camera.shift_x), float(camera.shift_y)],
    }


def _links() -> set[str]:
    """Absolute paths of everything outside the file itself that the scene names."""
    named = [library.filepath for library in bpy.data.libraries]
    for block in (bpy.data.images, bpy.data.sounds, bpy.data.movieclips, bpy.data.volumes):
        named += [b.filepath for b in block if not getattr(b, "packed_file", None)]
    named += [font.filepath for font in bpy.data.fonts if font.filepath != "<builtin>"]
    named += [cache.filepath for cache in bpy.data.cache_files]
    return {str(Path(bpy.path.abspath(name)).resolve()) for name in named if name}
