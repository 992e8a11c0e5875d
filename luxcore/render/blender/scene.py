"""A Room and a view as a Blender scene: geometry, light groups, environment, camera."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from luxcore.cameras import OPENGL_FROM_OPENCV, Camera
from luxcore.render.blender.lights import LAMP_PROPERTY, OUTSIDE
from luxcore.render.blender.materials import build_material, emitter_material
from luxcore.render.effects import Effects
from luxcore.render.hdri import hdri_path, mean_luminance, usable_radiance
from luxcore.render.views import PanoramaView, View
from luxcore.rooms.model import Environment, Opening, Part, Room, Spot

AMBIENT_GROUP = "ambient"
FIXTURE_INDEX, EMITTER_INDEX = 2, 3
"""Object index of lamp i: 10·(i+1) + one of these; everything else has index 0."""


def lamp_group(index: int) -> str:
    """The name of the light group and of the stored part of a lamp."""
    return f"light_{index:02d}"


def build_scene(room: Room, effects: Effects) -> Any:
    """Replace whatever Blender holds by this room, without a camera; returns the scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    layer = scene.view_layers[0]
    for name in (AMBIENT_GROUP, *(lamp_group(k) for k in range(len(room.lamps)))):
        layer.lightgroups.add(name=name)
    materials = {k: build_material(k, m) for k, m in room.materials.items()}
    for number, part in enumerate(room.parts):
        _add_part(scene, number, part, materials)
    for number, spot in enumerate(room.spots):
        _add_spot(scene, number, spot)
    world = bpy.data.worlds.new("world")
    scene.world = world
    world.lightgroup = AMBIENT_GROUP
    if room.environment is not None and effects.environment.on:
        _add_environment(world, room.environment)
    else:
        world.node_tree.nodes["Background"].inputs["Color"].default_value = (0, 0, 0, 1)
    if effects.portals.on:
        for number, opening in enumerate(room.openings):
            _add_portal(scene, number, opening)
    return scene


def place_camera(scene: Any, view: View) -> None:
    """Make the scene look through this view; an earlier camera is replaced."""
    if scene.camera is not None:
        bpy.data.cameras.remove(scene.camera.data)
    camera = bpy.data.cameras.new("view")
    holder = bpy.data.objects.new("view", camera)
    scene.collection.objects.link(holder)
    scene.camera = holder
    camera.clip_start, camera.clip_end = 0.01, 1000.0
    scene.render.resolution_x, scene.render.resolution_y = view.width, view.height
    scene.render.resolution_percentage = 100
    if isinstance(view, PanoramaView):
        camera.type, camera.panorama_type = "PANO", "EQUIRECTANGULAR"
        # Cycles' panorama looks along -z of the camera with y up: turn it to world +x, z up.
        holder.matrix_world = _matrix(_panorama_c2w(view))
    else:
        _set_pinhole(camera, holder, view)


def _panorama_c2w(view: PanoramaView) -> np.ndarray:
    yaw = math.radians(view.yaw_deg)
    forward = np.array([math.cos(yaw), math.sin(yaw), 0.0])
    left = np.array([-math.sin(yaw), math.cos(yaw), 0.0])
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([-left, np.array([0, 0, 1.0]), -forward], axis=1)
    matrix[:3, 3] = view.position
    return matrix


def _set_pinhole(camera: Any, holder: Any, view: Camera) -> None:
    holder.matrix_world = _matrix(view.c2w @ OPENGL_FROM_OPENCV)
    camera.type, camera.sensor_fit = "PERSP", "HORIZONTAL"
    camera.sensor_width = 36.0
    camera.lens = 36.0 * view.fx / view.width
    # Shifts are in units of the image's width.
    camera.shift_x = (view.width / 2 - view.cx) / view.width
    camera.shift_y = (view.cy - view.height / 2) / view.width


def _matrix(values: np.ndarray) -> Any:
    from mathutils import Matrix

    return Matrix([list(map(float, row)) for row in values])


def _add_part(scene: Any, number: int, part: Part, materials: dict[str, Any]) -> None:
    mesh = part.shape.mesh()
    data = bpy.data.meshes.new(f"{number:04d}")
    data.from_pydata(mesh.vertices.tolist(), [], [list(f) for f in mesh.faces])
    if part.smooth:
        data.polygons.foreach_set("use_smooth", np.ones(len(mesh.faces), bool))
    if part.emits > 0:
        # A Lambertian emitter of power P and area A has radiance P / (pi A); here P is 1 W.
        data.materials.append(emitter_material(f"e{number}", part.emits / math.pi / mesh.area_m2))
    else:
        data.materials.append(materials[part.material])
    holder = bpy.data.objects.new(f"{number:04d}", data)
    scene.collection.objects.link(holder)
    holder.location = part.position
    holder.rotation_euler = tuple(math.radians(a) for a in part.rotation_deg)
    if part.lamp is not None:
        holder.pass_index = 10 * (part.lamp + 1) + (
            EMITTER_INDEX if part.emits > 0 else FIXTURE_INDEX
        )
        holder.lightgroup = lamp_group(part.lamp)
        if part.emits > 0:
            holder[LAMP_PROPERTY] = part.lamp


def _add_spot(scene: Any, number: int, spot: Spot) -> None:
    light = bpy.data.lights.new(f"spot{number}", "SPOT")
    # Blender's spot gives the power of a whole sphere: the beam keeps its share of the lamp's.
    solid_angle = 2 * math.pi * (1 - math.cos(math.radians(spot.cone_deg) / 2))
    light.energy = spot.emits * 4 * math.pi / solid_angle
    light.spot_size, light.spot_blend = math.radians(spot.cone_deg), spot.blend
    light.shadow_soft_size = spot.radius_m
    holder = bpy.data.objects.new(f"spot{number}", light)
    scene.collection.objects.link(holder)
    holder.location = spot.position
    holder.rotation_euler = _toward(spot.direction)
    holder.lightgroup = lamp_group(spot.lamp)
    holder[LAMP_PROPERTY] = spot.lamp


def _add_portal(scene: Any, number: int, opening: Opening) -> None:
    light = bpy.data.lights.new(f"portal{number}", "AREA")
    light.shape, light.size, light.size_y = "RECTANGLE", opening.width, opening.height
    light.cycles.is_portal = True
    holder = bpy.data.objects.new(f"portal{number}", light)
    scene.collection.objects.link(holder)
    holder.location = opening.center
    holder.rotation_euler = _toward((*opening.inward, 0.0))
    holder[LAMP_PROPERTY] = OUTSIDE


def _toward(direction: tuple[float, float, float]) -> Any:
    from mathutils import Vector

    return Vector(direction).to_track_quat("-Z", "Y").to_euler()


def _add_environment(world: Any, environment: Environment) -> None:
    path = hdri_path(environment.hdri)
    # The automatic map costs 1.8 CPU-seconds a room; this one 0.2, at the same noise.
    world.cycles.sampling_method = "MANUAL"
    world.cycles.sample_map_resolution = 512
    tree = world.node_tree
    background = tree.nodes["Background"]
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = _environment_image(path)
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value[2] = math.radians(environment.rotation_deg)
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    background.inputs["Strength"].default_value = environment.mean_radiance / mean_luminance(path)


def _environment_image(path: Path) -> Any:
    """The file as it is, or its usable radiance where values had to be changed."""
    radiance, changed = usable_radiance(path)
    if not changed:
        return bpy.data.images.load(str(path))
    height, width, _ = radiance.shape
    image = bpy.data.images.new("environment", width, height, float_buffer=True)
    image.colorspace_settings.name = "Linear Rec.709"
    # Blender's rows go upward.
    pixels = np.dstack([radiance[::-1], np.ones((height, width, 1))]).astype(np.float32)
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    return image
