"""How well fitted lights match the light images of views they were not fitted to."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from jaxtyping import Float32

from luxcore.light.agx import agx
from luxcore.metrics.image import psnr
from luxcore.splats.light_fit import LightFit
from luxcore.splats.light_views import light_names


class LightQuality:
    """Measures a fit on its held-out views; on its training views where none are held out."""

    def __init__(self, fit: LightFit) -> None:
        self.fit = fit
        self.views = fit.split.held_out or fit.split.training

    def psnr_lights(self) -> float:
        """Mean PSNR over lights and views, in dB of AgX(exposure · radiance)."""
        return float(
            np.mean([self._psnrs(i, self.fit.render(v)) for i, v in enumerate(self.views)])
        )

    def metrics(self) -> dict[str, float]:
        """PSNR per light and of the recombined photo (dB, AgX), and the linear relative error.

        `relative_error_…` is Σ|error| / Σ light over the pixels of a view.
        """
        fit, weights = self.fit, self.fit.mixing()[0]
        psnrs, relative, composed = [], [], []
        for index, view in enumerate(self.views):
            fitted, target = fit.render(view), self._target(view)
            psnrs.append(self._psnrs(index, fitted))
            error = np.abs(fitted - target).sum(axis=(0, 1, 3))
            relative.append(error / np.maximum(target.sum(axis=(0, 1, 3)), 1e-9))
            total = (fitted * weights).sum(axis=2) * fit.exposure
            composed.append(psnr(agx(total), fit.views.photos[view].get()))
        names = light_names(len(weights) - 1)
        means = dict(zip(names, np.mean(psnrs, axis=0), strict=True))
        errors = dict(zip(names, np.mean(relative, axis=0), strict=True))
        return {
            "psnr_composed": float(np.mean(composed)),
            "psnr_lights": float(np.mean(psnrs)),
            **{f"psnr_{name}": float(value) for name, value in means.items()},
            **{f"relative_error_{name}": float(value) for name, value in errors.items()},
        }

    @cached_property
    def _shown(self) -> list[list[Float32[np.ndarray, "h w 3"]]]:
        """The light images as a display shows them, by view and light."""
        return [self._lights_shown(self._target(view)) for view in self.views]

    def _psnrs(self, index: int, fitted: Float32[np.ndarray, "h w m 3"]) -> list[float]:
        shown = self._lights_shown(fitted)
        return [psnr(a, b) for a, b in zip(shown, self._shown[index], strict=True)]

    def _lights_shown(self, image: Float32[np.ndarray, "h w m 3"]) -> list[np.ndarray]:
        lights = range(image.shape[2])
        return [agx(self.fit.exposure * image[:, :, m]).astype(np.float32) for m in lights]

    def _target(self, view: int) -> Float32[np.ndarray, "h w m 3"]:
        image = self.fit.views.targets[view].get()
        return image.reshape(*image.shape[:2], -1, 3) * self.fit.views.units[:, None]
