"""Lights on frozen geometry: gradient steps on L1 and D-SSIM, or least squares by conjugate
gradients.

Least squares minimizes Σ_v |W_v L − target_v|² over all training views at once, each light channel
by itself (CGLS: Björck 1996, "Numerical Methods for Least Squares Problems", algorithm 7.4.1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from luxcore.capture import Capture, load_capture
from luxcore.masks.store import load_masks
from luxcore.settings.relight import RelightSettings
from luxcore.splats.baked import BakedView, bake, padded, padded_zeros
from luxcore.splats.device import Device
from luxcore.splats.light_fit import LightFit
from luxcore.splats.light_quality import LightQuality
from luxcore.splats.stage2 import open_light_fit
from luxcore.tradeoff.knob import Bench, Choice, Knob, Work, around, stopwatch

MAX_SIDE = 160
JOINT = 100
GRADIENT, SQUARES = "gradient", "least squares"
_TINY = np.float32(1e-20)


@dataclass(frozen=True)
class Frozen:
    """A fit whose geometry is final; each copy starts from the same lights."""

    bench: Bench
    capture: Capture
    state: dict[str, np.ndarray]

    def start(self, frozen_iterations: int) -> LightFit:
        """The fit at the beginning of the frozen phase."""
        fit = _open(self.bench, self.capture, frozen_iterations)
        fit.load(JOINT, self.state)
        return fit


def freeze(bench: Bench) -> Frozen:
    """Run the joint phase once."""
    capture = load_capture(bench.input("capture"))
    fit = _open(bench, capture, 0)
    for _ in range(JOINT):
        fit.step()
    return Frozen(bench, capture, fit.state())


def baked_views(device: Device, fit: LightFit) -> dict[int, BakedView]:
    """The blending weights of all training views."""
    baked = {}
    for view in fit.split.training:
        camera = fit.views.cameras[view]
        out = fit.rasterizer.forward(camera, *fit.model.geometry, fit.lights)
        baked[view] = bake(device, out)
    return baked


def _open(bench: Bench, capture: Capture, frozen_iterations: int) -> LightFit:
    update = {
        "joint_iterations": JOINT, "frozen_iterations": frozen_iterations, "max_side": MAX_SIDE,
    }  # fmt: skip
    settings = bench.params.relight.model_copy(update=update)
    lamps = load_masks(bench.input("masks")).lamps
    stage1, fuse = bench.input("splat"), bench.input("fuse")
    return open_light_fit(capture, stage1, fuse, lamps, settings, seed=0)


class _Normal:
    """W of all training views stacked, and the light images that it should give."""

    def __init__(self, fit: LightFit) -> None:
        self.fit, self.device = fit, fit.device
        self.baked = baked_views(self.device, fit)
        self.targets = {view: fit.views.targets[view].get() for view in self.baked}

    def images(self, lights: np.ndarray) -> dict[int, np.ndarray]:
        """W · lights of every view."""
        rows, images = padded(self.device, lights), {}
        for view, baked in self.baked.items():
            shape = self.targets[view].shape
            image = padded_zeros(self.device, shape[0] * shape[1], shape)
            baked.render(rows, image)
            images[view] = image.get()
        return images

    def gathered(self, images: dict[int, np.ndarray]) -> np.ndarray:
        """Wᵀ · images, summed over the views."""
        total = np.zeros(self.fit.lights.shape, np.float32)
        out = self.device.empty(self.fit.lights.shape)
        for view, image in images.items():
            flat = padded(self.device, image.reshape(-1, image.shape[-1])).reshape(image.shape)
            self.baked[view].gather(flat, out)
            total += out.get()
        return total


def least_squares(fit: LightFit, iterations: int) -> None:
    """Replace the lights of `fit` by those that rebuild the light images best; never negative."""
    system = _Normal(fit)
    lights = fit.lights.get()
    shown = system.images(lights)
    residual = {view: system.targets[view] - image for view, image in shown.items()}
    gradient = system.gathered(residual)
    step, power = gradient.copy(), (gradient**2).sum(axis=0)
    for _ in range(iterations):
        moved = system.images(step)
        energy = sum((image**2).sum(axis=(0, 1)) for image in moved.values())
        length = power / np.maximum(energy, _TINY)
        lights += length * step
        for view, image in moved.items():
            residual[view] -= length * image
        gradient = system.gathered(residual)
        before, power = power, (gradient**2).sum(axis=0)
        step = gradient + power / np.maximum(before, _TINY) * step
    fit.lights = padded(fit.device, np.maximum(lights, 0))


def _run(prepared: Frozen, choice: Choice, repeat: int) -> Work:
    way, count = choice.label.rsplit(" ", 1)
    fit = prepared.start(int(count))
    fit.seed = repeat
    with stopwatch() as watch:
        if way == SQUARES:
            least_squares(fit, int(count))
        else:
            for _ in range(int(count)):
                fit.step()
        fit.device.queue.finish()
    return watch.work(10.0 ** (-LightQuality(fit).psnr_lights() / 20.0))


DEFAULT = RelightSettings().frozen_iterations

SOLVER = Knob(
    name="gradient steps or least squares on frozen geometry",
    work="lights fitted on frozen geometry",
    choices=(
        *(Choice(f"{GRADIENT} {n}", {}) for n in around(DEFAULT, 0.25, 0.5, 1, 2)),
        *(Choice(f"{SQUARES} {n}", {}) for n in (1, 2, 4, 8)),
    ),
    error="RMS error of single lamps in held-out views, display 0..1",
    why="Least squares errs more from its first pass on, and further passes fit what the views "
    "disagree about: held-out views get worse. Gradient steps do not; 38 of them would do here.",
    prepare=freeze,
    run=_run,
    fixed_default=f"{GRADIENT} {DEFAULT}",
)
