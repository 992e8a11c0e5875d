"""The optimization of stage 2: radiance per light on every Gaussian, all lights in one pass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyopencl.array as cla
from jaxtyping import Float32

from luxcore.settings.relight import RelightSettings
from luxcore.splats.backprojection import backproject
from luxcore.splats.baked import BakedView, bake_within, padded, padded_zeros
from luxcore.splats.checkpoint import part, prefixed
from luxcore.splats.device import Device
from luxcore.splats.gaussians import Gaussians
from luxcore.splats.light_views import LightViews
from luxcore.splats.losses.composition import (
    START_CURVE,
    CompositionLoss,
    ToneCurve,
    raw_parameters,
    read_parameters,
)
from luxcore.splats.losses.image import ImageLoss
from luxcore.splats.losses.smoothness import SmoothnessLoss, nearest_neighbors
from luxcore.splats.model import GEOMETRY, DeviceGaussians
from luxcore.splats.optimizer import Adam
from luxcore.splats.rasterizer import RasterConfig, Rasterizer
from luxcore.splats.rates import Rates
from luxcore.splats.starting_weights import starting_weights
from luxcore.splats.views import Split, view_at


@dataclass
class _Workspace:
    """Losses and images of one view size."""

    image: ImageLoss
    composition: CompositionLoss
    rendered: cla.Array
    d_image: cla.Array


class LightFit:
    """Lights [n, 3M] in units of each light, scale factors and tone curve, stepped in place."""

    def __init__(
        self,
        device: Device,
        views: LightViews,
        split: Split,
        gaussians: Gaussians,
        on: Sequence[bool],
        rates: Rates,
        settings: RelightSettings,
        *,
        exposure: float,
        seed: int,
    ) -> None:
        self.device, self.views, self.split = device, views, split
        self.rates, self.settings, self.exposure, self.seed = rates, settings, exposure, seed
        self.model = DeviceGaussians.upload(device, gaussians)
        config = RasterConfig(channels=views.channels, antialiased=gaussians.antialiased)
        self.rasterizer = Rasterizer(device, config)
        self.adam, self.done = Adam(device), 0
        weights = starting_weights(views, split.training, on, exposure)
        self.params = device.array(raw_parameters(weights, START_CURVE))
        # A lamp that was off is in no photo: its scale factor is not to be learnt from them.
        learnt = np.append(np.repeat([True, *on], 3), [True, True])
        self._learnt = device.array(learnt.astype(np.float32))
        self._one_row = device.array(np.ones(1, np.uint8))
        self._every_row = device.array(np.ones(self.model.count, np.uint8))
        self._workspaces: dict[tuple[int, ...], _Workspace] = {}
        self._baked: dict[int, BakedView] | None = None
        self._smoothness: SmoothnessLoss | None = None
        self.lights = padded(device, self._initial_lights())

    def step(self) -> None:
        """One iteration: joint while they last, then on frozen geometry."""
        view = view_at(self.done, self.split.training, self.seed)
        self.adam.next_step()
        if self.done < self.settings.joint_iterations:
            self._joint_step(view)
        else:
            self._frozen_step(view)
        self.done += 1

    def render(self, view: int) -> Float32[np.ndarray, "h w m 3"]:
        """Linear radiance of every light in a view."""
        out = self.rasterizer.forward(self.views.cameras[view], *self.model.geometry, self.lights)
        image = out.image.get()
        return image.reshape(*image.shape[:2], -1, 3) * self.views.units[:, None]

    def radiance(self) -> Float32[np.ndarray, "n m 3"]:
        """Linear radiance of every light on every Gaussian, in units of the fused images."""
        lights = self.lights.get()
        return lights.reshape(len(lights), -1, 3) * self.views.units[:, None]

    def mixing(self) -> tuple[Float32[np.ndarray, "m 3"], ToneCurve]:
        """The learnt scale factors w and tone curve."""
        return read_parameters(self.params.get())

    def state(self) -> dict[str, np.ndarray]:
        """Everything the next iteration depends on."""
        gaussians = self.model.download()
        names = (*GEOMETRY, "sh")
        return {
            **prefixed("model", {name: getattr(gaussians, name) for name in names}),
            **prefixed("adam", self.adam.state()),
            "lights": self.lights.get(),
            "params": self.params.get(),
        }

    def load(self, done: int, state: dict[str, np.ndarray]) -> None:
        """Continue after `done` iterations."""
        self.done = done
        gaussians = Gaussians(**part(state, "model"), antialiased=self.model.antialiased)
        self.model = DeviceGaussians.upload(self.device, gaussians)
        self.adam.load(part(state, "adam"))
        self.lights = padded(self.device, state["lights"])
        self.params = self.device.array(state["params"])

    def _joint_step(self, view: int) -> None:
        work, model, rates = self._workspace(view), self.model, self.rates
        camera = self.views.cameras[view]
        out = self.rasterizer.forward(camera, *model.geometry, self.lights)
        self._compare(work, view, out.image)
        g = self.rasterizer.backward(out, work.d_image)
        seen = g.visible
        means_rate = rates.means_at(self.done, self.settings.joint_iterations)
        self.adam.apply("means", model.means, g.means, seen, means_rate)
        self.adam.apply("quats", model.quats, g.quats, seen, rates.quats)
        self.adam.apply("log_scales", model.log_scales, g.log_scales, seen, rates.log_scales)
        logits = (model.opacity_logits, g.opacity_logits)
        self.adam.apply("opacity_logits", *logits, seen, rates.opacity_logits)
        self._move_lights(work, g.colors, seen)

    def _frozen_step(self, view: int) -> None:
        work, baked = self._workspace(view), self._weights(view)
        d_lights = self.device.empty(self.lights.shape)
        if baked is None:
            camera = self.views.cameras[view]
            out = self.rasterizer.forward(camera, *self.model.geometry, self.lights)
            self._compare(work, view, out.image)
            d_lights = self.rasterizer.color_gradients(out, work.d_image)
            seen = (out.radii > 0).astype(np.uint8)
        else:
            baked.render(self.lights, work.rendered)
            self._compare(work, view, work.rendered)
            baked.gather(work.d_image, d_lights)
            seen = baked.visible
        if self._is_smoothing():
            # This loss is of all Gaussians, also of those that the view does not see.
            self._neighbors().add_gradient(self.lights, d_lights)
            seen = self._every_row
        self._move_lights(work, d_lights, seen)

    def _compare(self, work: _Workspace, view: int, image: cla.Array) -> None:
        work.image.gradient(image, self.views.targets[view], work.d_image)
        work.composition.gradient(image, self.views.toned[view], self.params, work.d_image)

    def _move_lights(self, work: _Workspace, d_lights: cla.Array, seen: cla.Array) -> None:
        s = self.settings
        self.adam.apply("lights", self.lights, d_lights, seen, s.light_rate, lower=0.0)
        d_params = (work.composition.d_params * self._learnt).reshape(1, -1)
        row = self.params.reshape(1, -1)
        scales = 3 * len(self.views.units)
        self.adam.apply(
            "params", row, d_params, self._one_row, s.weight_rate,
            lower=0.0, head=scales, tail_rate=s.weight_rate,
        )  # fmt: skip

    def _is_smoothing(self) -> bool:
        frozen = self.done - self.settings.joint_iterations + 1
        return self.settings.smoothness_weight > 0 and frozen % self.settings.smoothness_every == 0

    def _neighbors(self) -> SmoothnessLoss:
        if self._smoothness is None:
            table = nearest_neighbors(self.model.means.get(), self.settings.neighbors)
            weight = self.settings.smoothness_weight
            self._smoothness = SmoothnessLoss(self.device, table, self.views.channels, weight)
        return self._smoothness

    def _weights(self, view: int) -> BakedView | None:
        """Cached blending weights; None where the memory for them is used up."""
        if self._baked is None:
            self._baked = self._bake_views()
        return self._baked.get(view)

    def _bake_views(self) -> dict[int, BakedView]:
        """Blending weights of the first training views, as many as the memory cap holds.

        By index and all at once: gradients of baked views are summed in another order, so a choice
        by which view came first would give other bits after a resumption.
        """
        baked: dict[int, BakedView] = {}
        left = self.settings.max_baked_mb * 2**20
        for view in self.split.training:
            camera = self.views.cameras[view]
            out = self.rasterizer.forward(camera, *self.model.geometry, self.lights)
            weights = bake_within(self.device, out, left)
            if weights is None:
                break
            baked[view] = weights
            left -= weights.nbytes
        return baked

    def _initial_lights(self) -> Float32[np.ndarray, "n m3"]:
        """Each Gaussian's mean of the fused images under its blending weights in all views."""
        n, channels = self.model.count, self.views.channels
        sums, weights = np.zeros((n, channels)), np.zeros(n)
        blank = self.device.zeros((n, channels))
        for view in self.split.training:
            out = self.rasterizer.forward(self.views.cameras[view], *self.model.geometry, blank)
            found = backproject(self.device, self.rasterizer, out, self.views.targets[view])
            sums += found.sums
            weights += found.weights
        # What no view sees keeps the mean of all that is seen.
        mean = sums.sum(axis=0) / max(weights.sum(), 1e-12)
        lights = np.where(weights[:, None] > 1e-6, sums / np.maximum(weights, 1e-6)[:, None], mean)
        return lights.astype(np.float32)

    def _workspace(self, view: int) -> _Workspace:
        shape = self.views.targets[view].shape
        if shape not in self._workspaces:
            size, s = (shape[0], shape[1]), self.settings
            units = self.views.units * np.float32(self.exposure)
            pixels = size[0] * size[1]
            self._workspaces[shape] = _Workspace(
                ImageLoss(self.device, size, shape[2], 1.0, s.ssim_weight),
                CompositionLoss(self.device, size, units, s.composition_weight),
                padded_zeros(self.device, pixels, shape),
                padded_zeros(self.device, pixels, shape),
            )
        return self._workspaces[shape]
