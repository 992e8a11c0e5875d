"""The optimization of stage 1: one view per iteration, everything of it on the device."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pyopencl.array as cla

from luxcore.cameras import Camera
from luxcore.metrics.image import psnr
from luxcore.splats.backprojection import backproject, view_directions
from luxcore.splats.checkpoint import part, prefixed
from luxcore.splats.density import Edit, Strategy
from luxcore.splats.device import Device
from luxcore.splats.gaussians import SH_C0, Gaussians
from luxcore.splats.harmonics import sh_backward, sh_forward
from luxcore.splats.harmonics_choice import HarmonicsChoice, choose_degree
from luxcore.splats.losses.image import ImageLoss
from luxcore.splats.model import DeviceGaussians
from luxcore.splats.morton import morton_order
from luxcore.splats.optimizer import Adam
from luxcore.splats.rasterizer import (
    RasterConfig,
    RasterGradients,
    Rasterizer,
    RasterOutput,
)
from luxcore.splats.rates import Rates
from luxcore.splats.views import Split, Views, view_at

_BLACK = -0.5 / SH_C0
"""The constant coefficient of black. Colours are kept above it after a step, not clamped before."""


class GeometryFit:
    """Gaussians, their optimizer and their density control, stepped one iteration at a time."""

    def __init__(
        self,
        device: Device,
        views: Views,
        split: Split,
        gaussians: Gaussians,
        strategy: Strategy,
        rates: Rates,
        *,
        iterations: int,
        ssim_weight: float,
        seed: int,
    ) -> None:
        self.device, self.views, self.split, self.strategy = device, views, split, strategy
        self.rates, self.iterations, self.seed = rates, iterations, seed
        self.model = DeviceGaussians.upload(device, gaussians)
        self.adam = Adam(device)
        self.done = 0
        config = RasterConfig(channels=3, antialiased=gaussians.antialiased)
        self.rasterizer = Rasterizer(device, config)
        self._ssim_weight = ssim_weight
        self._losses: dict[tuple[int, ...], ImageLoss] = {}

    @property
    def degree(self) -> int:
        """Of the spherical harmonics in use."""
        return round(self.model.sh.shape[1] ** 0.5) - 1

    def step(self) -> None:
        """One iteration: render, compare, differentiate, move, refine."""
        view = view_at(self.done, self.split.training, self.seed)
        camera, target = self.views.cameras[view], self.views.targets[view]
        model, centre = self.model, camera.centre
        rgb = sh_forward(self.device, model.means, model.sh, centre, self.degree, clamp=False)
        out = self.rasterizer.forward(camera, *model.geometry, rgb)
        d_image = self.device.empty(target.shape)
        self._loss(target.shape).gradient(out.image, target, d_image)
        gradients = self.rasterizer.backward(out, d_image)
        d_sh, d_means = sh_backward(
            self.device, model.means, model.sh, centre, rgb, gradients.colors, self.degree,
            clamp=False,
        )  # fmt: skip
        if self.degree:
            gradients = replace(gradients, means=gradients.means + d_means)
        self.strategy.before_step(model, gradients)
        self._move(gradients, d_sh)
        self.strategy.after_step(model, out, gradients, self.done)
        self.done += 1
        random = np.random.Generator(np.random.PCG64([self.seed, 2, self.done]))
        edit = self.strategy.refine(model, self.done, random)
        if edit is not None:
            self._replace(edit)

    def render(self, camera: Camera) -> RasterOutput:
        """The current Gaussians from a camera, colours clamped at zero as any viewer shows them."""
        model = self.model
        rgb = sh_forward(self.device, model.means, model.sh, camera.centre, self.degree)
        return self.rasterizer.forward(camera, *model.geometry, rgb)

    def measure(self, views: tuple[int, ...]) -> list[float]:
        """PSNR in dB of each of `views`."""
        cameras, targets = self.views.cameras, self.views.targets
        shown = (np.clip(self.render(cameras[v]).image.get(), 0, 1) for v in views)
        return [psnr(image, targets[v].get()) for image, v in zip(shown, views, strict=True)]

    def ask_for_harmonics(self) -> HarmonicsChoice:
        """Whether the training residuals earn degree 1; if so, it is used from here on."""
        residuals, directions = [], []
        for view in self.split.training:
            out = self.render(self.views.cameras[view])
            difference = self.views.targets[view] - out.image
            residuals.append(backproject(self.device, self.rasterizer, out, difference))
            directions.append(view_directions(self.model.means.get(), self.views.cameras[view]))
        choice = choose_degree(residuals, directions)
        if choice.degree > self.degree:
            self.set_degree(choice.degree)
        return choice

    def set_degree(self, degree: int) -> None:
        """Continue with coefficients up to `degree`, the new ones zero."""
        old = self.model.sh.get()
        grown = np.zeros((len(old), (degree + 1) ** 2, 3), np.float32)
        grown[:, : old.shape[1]] = old
        self.model.sh = self.device.array(grown)
        self.adam.forget("sh")

    def state(self) -> dict[str, np.ndarray]:
        """Everything the next iteration depends on."""
        gaussians = self.model.download()
        names = ("means", "quats", "log_scales", "opacity_logits", "sh")
        return {
            **prefixed("model", {name: getattr(gaussians, name) for name in names}),
            **prefixed("adam", self.adam.state()),
            **prefixed("density", self.strategy.state()),
        }

    def load(self, done: int, state: dict[str, np.ndarray]) -> None:
        """Continue after `done` iterations."""
        self.done = done
        gaussians = Gaussians(**part(state, "model"), antialiased=self.model.antialiased)
        self.model = DeviceGaussians.upload(self.device, gaussians)
        self.adam.load(part(state, "adam"))
        self.strategy.load(part(state, "density"))

    def _move(self, gradients: RasterGradients, d_sh: cla.Array) -> None:
        model, adam, rates, seen = self.model, self.adam, self.rates, gradients.visible
        adam.next_step()
        means_rate = rates.means_at(self.done, self.iterations)
        adam.apply("means", model.means, gradients.means, seen, means_rate)
        adam.apply("quats", model.quats, gradients.quats, seen, rates.quats)
        adam.apply("log_scales", model.log_scales, gradients.log_scales, seen, rates.log_scales)
        logits = (model.opacity_logits, gradients.opacity_logits)
        adam.apply("opacity_logits", *logits, seen, rates.opacity_logits)
        adam.apply(
            "sh", model.sh, d_sh, seen, rates.sh_constant,
            lower=_BLACK, head=3, tail_rate=rates.sh_higher,
        )  # fmt: skip

    def _replace(self, edit: Edit) -> None:
        edit = edit.take(morton_order(edit.gaussians.means))
        self.model = DeviceGaussians.upload(self.device, edit.gaussians)
        self.adam.rearrange(edit.parents, edit.fresh)

    def _loss(self, shape: tuple[int, ...]) -> ImageLoss:
        if shape not in self._losses:
            size, weight = (shape[0], shape[1]), self._ssim_weight
            self._losses[shape] = ImageLoss(self.device, size, 3, 1 - weight, weight)
        return self._losses[shape]
