"""One Cycles render to arrays: every light group, guides of the denoiser, geometry, indices."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from luxcore.render.effects import Effects
from luxcore.render.views import ENVIRONMENT_DISTANCE_M


@dataclass(frozen=True)
class Passes:
    """One render. Images are [h, w, 3] float32; linear radiance; normals in the world frame."""

    groups: dict[str, np.ndarray]
    combined: np.ndarray
    """The renderer's own sum of all groups."""
    albedo: np.ndarray
    normal: np.ndarray
    guide_albedo: np.ndarray
    guide_normal: np.ndarray
    ray_distance_m: np.ndarray
    """[h, w]; ENVIRONMENT_DISTANCE_M where nothing was hit."""
    index: np.ndarray
    """[h, w] object index, 0 for what belongs to no lamp."""
    outside: np.ndarray
    """[h, w] bool: the ray met nothing."""


def sum_error(passes: Passes) -> float:
    """How far Σ groups is from the combined image: largest difference over the largest value."""
    total = np.sum([g.astype(np.float64) for g in passes.groups.values()], axis=0)
    peak = float(np.abs(passes.combined).max())
    return float(np.abs(total - passes.combined).max()) / peak if peak > 0 else 0.0


def configure(scene: Any, effects: Effects, *, spp: int, seed: int, threads: int) -> None:
    """Set the integrator from the effects of the room; nothing is left at a lossy default."""
    scene.render.engine = "CYCLES"
    scene.render.threads_mode, scene.render.threads = "FIXED", threads
    scene.render.use_persistent_data = True
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.seed = "CPU", spp, seed % 2**31
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    cycles.use_guiding = False
    # Blender's clamp of 10 takes 37-47 % of two lamps' energy and breaks linearity.
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    # The default skips dim lights and so breaks the sum of the groups.
    cycles.light_sampling_threshold = 0.0
    cycles.use_auto_tile = False
    cycles.blur_glossy = 1.0
    cycles.diffuse_bounces = effects.diffuse.amount
    cycles.glossy_bounces = effects.glossy.amount
    cycles.transmission_bounces = effects.transmission.amount
    cycles.transparent_max_bounces = effects.transparent.amount
    cycles.max_bounces = max(effects.diffuse.amount, effects.transmission.amount) + 2
    cycles.caustics_reflective = cycles.caustics_refractive = effects.caustics.on
    cycles.use_light_tree = effects.light_tree.on
    _enable_passes(scene.view_layers[0])


def render(scene: Any) -> Passes:
    """Render the scene's camera once."""
    with tempfile.TemporaryDirectory(prefix="lux-render-") as folder:
        path = Path(folder) / "passes.exr"
        scene.render.filepath = str(path)
        image = scene.render.image_settings
        image.media_type = "MULTI_LAYER_IMAGE"
        image.color_depth, image.exr_codec = "32", "NONE"
        bpy.ops.render.render(write_still=True)
        layers = _layers(path)
    eye = np.array(scene.camera.matrix_world.translation, np.float32)
    return _collect(layers, eye)


def _enable_passes(layer: Any) -> None:
    layer.use_pass_position = True
    layer.use_pass_normal = True
    layer.use_pass_object_index = True
    layer.use_pass_diffuse_color = True
    layer.use_pass_z = True
    layer.cycles.denoising_store_passes = True


def _layers(path: Path) -> dict[str, np.ndarray]:
    """Pixels by pass name: part "ViewLayer.Combined_light_00" → "Combined_light_00".

    Vectors are stored as channels X, Y, Z, which `luxcore.files.exr` (pictures) does not read.
    """
    import OpenEXR

    file = OpenEXR.File(str(path), separate_channels=True)
    return {part.name().split(".", 1)[-1]: _stacked(part.channels) for part in file.parts}


def _stacked(channels: Mapping[str, Any]) -> np.ndarray:
    planes = {name.split(".")[-1]: channel.pixels for name, channel in channels.items()}
    order = "RGBA" if "R" in planes else "XYZ" if "X" in planes else "".join(planes)
    return np.stack([planes[c] for c in order if c in planes], axis=-1)


def _collect(layers: dict[str, np.ndarray], eye: np.ndarray) -> Passes:
    prefix = "Combined_"
    groups = {
        name.removeprefix(prefix): pixels[..., :3]
        for name, pixels in layers.items()
        if name.startswith(prefix)
    }
    index = layers["Object Index"][..., 0]
    outside = layers["Depth"][..., 0] > 1e6
    position = layers["Position"][..., :3]
    distance = np.linalg.norm(position - eye, axis=2)
    return Passes(
        groups=groups,
        combined=layers["Combined"][..., :3],
        albedo=np.clip(layers["Diffuse Color"][..., :3], 0, 1),
        normal=_unit(layers["Normal"][..., :3]),
        guide_albedo=layers["Denoising Albedo"][..., :3],
        guide_normal=layers["Denoising Normal"][..., :3],
        ray_distance_m=np.where(outside, np.float32(ENVIRONMENT_DISTANCE_M), distance),
        index=index,
        outside=outside,
    )


def _unit(vectors: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=2, keepdims=True)
    return vectors / np.maximum(length, 1e-6)
