"""Batches for the two trainings, as pure functions of the step number: resume needs no state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.random import PCG64, Generator, SeedSequence
from torch import Tensor

from luxcore.data.crops import LitCrop
from luxcore.data.repaint import repainted
from luxcore.models.small.examples import Example, to_example
from luxcore.models.small.features import lamp_features
from luxcore.models.small.geometry import estimate_surfaces
from luxcore.models.small.hints import KnownLight, references_of
from luxcore.models.small.multiview import TargetView, multiview_features
from luxcore.models.small.network import UNet
from luxcore.models.small.samples import CropPool


@dataclass(frozen=True)
class SingleBatches:
    """Single photos of `pool`, newly lit each time, half of them mirrored.

    `repaint` is the share of photos whose surfaces get other colours, `geometry` the share that
    comes with true depth and normals; for the rest `estimator` guesses them, where there is one.
    """

    pool: CropPool
    seed: int
    photos: int = 5
    geometry: float = 0.5
    estimator: UNet | None = None
    repaint: float = 0.6

    def batch(self, step: int) -> list[tuple[Tensor, Example]]:
        """`photos` examples with the features of their lamps; photos that show no lamp are passed
        over."""
        rng = Generator(PCG64(SeedSequence((self.seed, step))))
        found: list[tuple[Tensor, Example]] = []
        while len(found) < self.photos:
            (crop,) = self.pool.relit(rng, 1)
            example = to_example(
                repainted(crop, rng) if rng.random() < self.repaint else crop,
                geometry=bool(rng.random() < self.geometry),
                flip=bool(rng.random() < 0.5),
            )
            if len(example.on):
                found.append((single_features(example, self.estimator), example))
        return found


@dataclass(frozen=True)
class GroupBatches:
    """Views of `pool` with the light of one or two neighbours given, as in a harmonizing pass."""

    pool: CropPool
    seed: int
    photos: int = 4

    def batch(self, step: int) -> list[tuple[Tensor, Example]]:
        """`photos` examples whose features hold the warped light of their references."""
        rng = Generator(PCG64(SeedSequence((self.seed, step))))
        found: list[tuple[Tensor, Example]] = []
        while len(found) < self.photos:
            target, *others = self.pool.relit(rng)
            references = others[: int(rng.integers(1, 3))]
            known = np.any([v.masks.any((1, 2)) for v in references], axis=0)
            if known.any():
                found.append(group_example(target, references, known, rng))
        return found


def group_example(
    target: LitCrop,
    references: Sequence[LitCrop],
    known: np.ndarray,
    rng: Generator | None = None,
) -> tuple[Tensor, Example]:
    """A target with the true light of its references; `rng` makes that light and depth imperfect,
    as a single-view model and estimated geometry would."""
    keep = known | target.masks.any((1, 2))
    if rng is not None:
        target = _bent(target, rng)
    example = to_example(target, geometry=True, keep=keep)
    lights = [_known_light(view, keep, rng) for view in references]
    view = TargetView(example.photo, example.masks, example.on, example.surfaces)
    told = references_of(lights, len(example.on))
    features, warped = multiview_features(view, target.camera, told)
    return features, replace(example, warped=warped)


def single_features(example: Example, estimator: UNet | None) -> Tensor:
    """Features of a photo's lamps; geometry that does not come with it is guessed."""
    surfaces = example.surfaces
    if surfaces is None and estimator is not None:
        surfaces = estimate_surfaces(estimator, example.photo)
    return lamp_features(example.photo, example.masks, example.on, surfaces)


def _known_light(view: LitCrop, keep: np.ndarray, rng: Generator | None) -> KnownLight:
    example = to_example(view, geometry=True, keep=keep)
    light = example.lights
    if rng is not None and rng.random() < 0.6:
        noise = [_smooth_noise(light.shape[-2:], rng, 0.25) for _ in range(len(light))]
        light = light * torch.stack(noise)[:, None].exp()
    assert example.surfaces is not None
    seen = torch.from_numpy(view.masks[keep].any((1, 2)))
    return KnownLight(
        view.camera, example.photo, example.masks, example.on, example.surfaces, light, seen
    )


def _bent(view: LitCrop, rng: Generator) -> LitCrop:
    """Depth with smooth errors of a few per cent, as splats and SfM have."""
    noise = _smooth_noise(view.depth_m.shape, rng, 0.02).numpy()
    return replace(view, depth_m=view.depth_m * np.exp(noise))


def _smooth_noise(shape: Sequence[int], rng: Generator, sigma: float) -> Tensor:
    coarse = torch.from_numpy(rng.normal(0, sigma, (1, 1, 4, 4))).float()
    return torch.nn.functional.interpolate(
        coarse, size=tuple(shape), mode="bicubic", align_corners=False
    )[0, 0]
