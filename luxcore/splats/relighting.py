"""Pictures of a scene under any mix of its lamps.

Light is linear: the image is Σ_m w_m · image_m, so lamps are mixed on the Gaussians before one
pass of three channels (a moving camera), or on cached layers without any pass (a fixed one).
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import pyopencl.array as cla
from jaxtyping import Float, Float32

from luxcore.cameras import Camera
from luxcore.errors import InputError
from luxcore.light.agx import agx
from luxcore.light.blackbody import LUMINANCE_709
from luxcore.splats.device import Device, open_device
from luxcore.splats.gaussians import Gaussians, sh_from_color
from luxcore.splats.light_views import AMBIENT
from luxcore.splats.model import DeviceGaussians
from luxcore.splats.rasterizer import RasterConfig, Rasterizer
from luxcore.splats.scene import Scene


@dataclass(frozen=True)
class LampSetting:
    """What the user asks of a lamp.

    `intensity` 1 is its brightness in the photos (or its own, if it was off), 0 is off. `color` is
    linear Rec.709 in 0..1 and takes the place of the lamp's own; white keeps its luminance.
    """

    intensity: float = 1.0
    color: tuple[float, float, float] | None = None


Settings = Mapping[str, LampSetting]


def mixing_weights(scene: Scene, settings: Settings | None = None) -> Float[np.ndarray, "m 3"]:
    """w [m, 3], ambient first; lamps that are not named stay as they were in the photos.

    Raises InputError for a lamp that the scene does not have.
    """
    settings = settings or {}
    names = [AMBIENT, *(lamp.name for lamp in scene.lamps)]
    for name in settings:
        if name not in names:
            raise InputError(_unknown_lamp(scene, name, names))
    scales = [scene.ambient_scale, *(lamp.scale for lamp in scene.lamps)]
    shone = [True, *(lamp.on for lamp in scene.lamps)]
    rows = []
    for name, scale, on in zip(names, scales, shone, strict=True):
        setting = settings.get(name, LampSetting(float(on)))
        rows.append(setting.intensity * _tinted(np.array(scale), setting.color))
    return np.array(rows)


def mixed_radiance(scene: Scene, settings: Settings | None = None) -> Float32[np.ndarray, "n 3"]:
    """Linear radiance of each Gaussian under the mix: Σ_m w_m · radiance_m."""
    weights = mixing_weights(scene, settings).astype(np.float32)
    return np.einsum("nmc,mc->nc", scene.radiance, weights)


def render_scene(
    scene: Scene, camera: Camera, settings: Settings | None = None
) -> Float32[np.ndarray, "h w 3"]:
    """Linear radiance [h, w, 3] of the scene from `camera`; display it with the scene's tone."""
    return MovingCamera(scene).render(camera, settings)


class MovingCamera:
    """Geometry stays on the device; each picture mixes colours and makes one pass."""

    def __init__(self, scene: Scene, device: Device | None = None) -> None:
        self.scene, self.device = scene, device or open_device()
        self._model = DeviceGaussians.upload(self.device, scene.gaussians)
        config = RasterConfig(channels=3, antialiased=scene.gaussians.antialiased)
        self._rasterizer = Rasterizer(self.device, config)

    def render(
        self, camera: Camera, settings: Settings | None = None
    ) -> Float32[np.ndarray, "h w 3"]:
        """Linear radiance."""
        colors = self.device.array(mixed_radiance(self.scene, settings))
        return self._rasterizer.forward(camera, *self._model.geometry, colors).image.get()


class FixedCamera:
    """All lights of one view, rendered once; a mix is then a weighted sum of layers."""

    def __init__(self, scene: Scene, camera: Camera, device: Device | None = None) -> None:
        self.scene, self.device = scene, device or open_device()
        n, lights = scene.radiance.shape[:2]
        self._size = (camera.height, camera.width)
        config = RasterConfig(channels=3 * lights, antialiased=scene.gaussians.antialiased)
        model = DeviceGaussians.upload(self.device, scene.gaussians)
        colors = self.device.array(scene.radiance.reshape(n, 3 * lights))
        out = Rasterizer(self.device, config).forward(camera, *model.geometry, colors)
        layers = np.moveaxis(out.image.get().reshape(*self._size, lights, 3), 2, 0)
        self._layers = self.device.array(np.ascontiguousarray(layers))
        self._image = self.device.empty((*self._size, 3))
        self._kernel = self.device.program("mix", {"LIGHTS": lights}).mix_layers

    def mix(self, settings: Settings | None = None) -> cla.Array:
        """Linear radiance [h, w, 3] on the device, overwritten by the next mix."""
        weights = self.device.array(mixing_weights(self.scene, settings).astype(np.float32))
        size = int(self._image.size)
        self.device.launch(self._kernel, -(-size // 48), self._layers, weights, size, self._image)
        return self._image

    def render(self, settings: Settings | None = None) -> Float32[np.ndarray, "h w 3"]:
        """Linear radiance on the host."""
        return self.mix(settings).get()


def splat_image(gaussians: Gaussians, camera: Camera) -> Float32[np.ndarray, "h w 3"]:
    """Any 3DGS scene from `camera`: its own (display-referred) colours, on black."""
    from luxcore.splats.harmonics import sh_forward

    device = open_device()
    model = DeviceGaussians.upload(device, gaussians)
    rgb = sh_forward(device, model.means, model.sh, camera.centre, gaussians.sh_degree)
    config = RasterConfig(channels=3, antialiased=gaussians.antialiased)
    return Rasterizer(device, config).forward(camera, *model.geometry, rgb).image.get()


def baked_gaussians(scene: Scene, settings: Settings | None = None) -> Gaussians:
    """The scene's Gaussians with the display colours of a mix, for viewers that know no lamps.

    Each Gaussian is tone-mapped before blending, which only approximates the tone-mapped image.
    """
    shown = agx(scene.tone.exposure * mixed_radiance(scene, settings))
    return replace(scene.gaussians, sh=sh_from_color(np.asarray(shown, np.float32)))


def solo(scene: Scene, name: str) -> dict[str, LampSetting]:
    """Settings under which only `name` shines."""
    names = [AMBIENT, *(lamp.name for lamp in scene.lamps)]
    return {other: LampSetting(float(other == name)) for other in names}


def _tinted(
    scale: Float[np.ndarray, 3], color: tuple[float, float, float] | None
) -> Float[np.ndarray, 3]:
    return scale if color is None else float(scale @ LUMINANCE_709) * np.array(color)


def _unknown_lamp(scene: Scene, name: str, names: list[str]) -> str:
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.4)
    hint = f" (nearest: {near[0]})" if near else ""
    return f"scene {scene.name} has no lamp {name!r}{hint}; it has {', '.join(names)}."
