"""Batches for the two trainings, as pure functions of the step number: resume needs no state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float
from numpy.random import PCG64, Generator, SeedSequence
from torch import Tensor

from luxcore.data.crops import LitCrop
from luxcore.data.grading import graded
from luxcore.data.repaint import repainted
from luxcore.models.small.examples import Example, to_example
from luxcore.models.small.features import lamp_features
from luxcore.models.small.geometry import estimate_surfaces
from luxcore.models.small.heads import OnGrid, lamp_light, light_fields
from luxcore.models.small.hints import KnownLight, references_of
from luxcore.models.small.multiview import TargetView, multiview_features
from luxcore.models.small.network import UNet
from luxcore.models.small.samples import CropPool


@dataclass(frozen=True)
class SingleBatches:
    """Single photos of `pool`, newly lit each time, half of them mirrored.

    `repaint` is the share of photos whose surfaces get other colours, `grade` the share finished as
    by another camera, `geometry` the share that comes with true depth and normals; for the rest
    `estimator` guesses them, where there is one.
    """

    pool: CropPool
    seed: int
    photos: int = 5
    geometry: float = 0.5
    estimator: UNet | None = None
    repaint: float = 0.6
    grade: float = 0.3

    def batch(self, step: int) -> list[tuple[Tensor, Example]]:
        """`photos` examples with the features of their lamps; photos that show no lamp are passed
        over."""
        rng = Generator(PCG64(SeedSequence((self.seed, step))))
        found: list[tuple[Tensor, Example]] = []
        while len(found) < self.photos:
            (crop,) = self.pool.relit(rng, 1)
            if rng.random() < self.repaint:
                crop = repainted(crop, rng)
            if rng.random() < self.grade:
                crop = graded(crop, rng)
            example = to_example(
                crop,
                geometry=bool(rng.random() < self.geometry),
                flip=bool(rng.random() < 0.5),
            )
            if len(example.on):
                found.append((single_features(example, self.estimator), example))
        return found


PREDICTED_SHARE = 0.4
"""Of training references whose light is what the single-view model makes of them."""

DISTURBED_SHARE = 0.6
"""Of the other ones whose light is wrong by smooth noise."""


@dataclass(frozen=True)
class GroupBatches:
    """Views of `pool` with the light of one or two neighbours given, as in a harmonizing pass.

    `single` is the single-view model that takes some references apart; without it their light is
    the truth, or near it.
    """

    pool: CropPool
    seed: int
    photos: int = 4
    single: UNet | None = None

    def batch(self, step: int) -> list[tuple[Tensor, Example]]:
        """`photos` examples whose features hold the warped light of their references."""
        rng = Generator(PCG64(SeedSequence((self.seed, step))))
        found: list[tuple[Tensor, Example]] = []
        while len(found) < self.photos:
            target, *others = self.pool.relit(rng)
            references = others[: int(rng.integers(1, 3))]
            known = np.any([v.masks.any((1, 2)) for v in references], axis=0)
            if known.any():
                disturbing = Disturbance(rng, self.single)
                found.append(group_example(target, references, known, disturbing))
        return found


@dataclass(frozen=True)
class Disturbance:
    """Makes light and depth imperfect, as a single-view model and estimated geometry do."""

    rng: Generator
    single: UNet | None = None
    predicted_share: float = PREDICTED_SHARE

    def light(self, example: Example, seen: Bool[Tensor, " k"]) -> Float[Tensor, "k 3 h w"]:
        """What a pass may be told of the light of a reference that shows the lamps `seen`."""
        if self.single is not None and self.rng.random() < self.predicted_share:
            return _predicted(self.single, example, seen)
        if self.rng.random() >= DISTURBED_SHARE:
            return example.lights
        shape = example.photo.shape[-2:]
        noise = [_smooth_noise(shape, self.rng, 0.25) for _ in range(len(example.on))]
        return example.lights * torch.stack(noise)[:, None].exp()

    def depth(self, view: LitCrop) -> LitCrop:
        """Depth with smooth errors of a few per cent, as splats and SfM have."""
        noise = _smooth_noise(view.depth_m.shape, self.rng, 0.02).numpy()
        return replace(view, depth_m=view.depth_m * np.exp(noise))


def group_example(
    target: LitCrop,
    references: Sequence[LitCrop],
    known: np.ndarray,
    disturbance: Disturbance | None = None,
) -> tuple[Tensor, Example]:
    """A target with the light of its references: true, or as `disturbance` makes it."""
    keep = known | target.masks.any((1, 2))
    if disturbance is not None:
        target = disturbance.depth(target)
    example = to_example(target, geometry=True, keep=keep)
    lights = [_known_light(view, keep, disturbance) for view in references]
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


def _known_light(view: LitCrop, keep: np.ndarray, disturbance: Disturbance | None) -> KnownLight:
    example = to_example(view, geometry=True, keep=keep)
    assert example.surfaces is not None
    seen = torch.from_numpy(view.masks[keep].any((1, 2)))
    light = example.lights if disturbance is None else disturbance.light(example, seen)
    return KnownLight(
        view.camera, example.photo, example.masks, example.on, example.surfaces, light, seen
    )


def _predicted(
    single: UNet, example: Example, seen: Bool[Tensor, " k"]
) -> Float[Tensor, "k 3 h w"]:
    """The light that the single-view model finds, geometry given; 0 of lamps that are not seen."""
    light = torch.zeros_like(example.lights)
    if bool(seen.any()):
        on = example.on[seen]
        shown = OnGrid(example.photo, example.masks[seen])
        features = lamp_features(shown.photo, shown.masks, on, example.surfaces)
        with torch.no_grad():
            fields = light_fields(single(features), on, shown)
        light[seen] = lamp_light(fields, example.photo, on)
    return light


def _smooth_noise(shape: Sequence[int], rng: Generator, sigma: float) -> Tensor:
    coarse = torch.from_numpy(rng.normal(0, sigma, (1, 1, 4, 4))).float()
    return torch.nn.functional.interpolate(
        coarse, size=tuple(shape), mode="bicubic", align_corners=False
    )[0, 0]
