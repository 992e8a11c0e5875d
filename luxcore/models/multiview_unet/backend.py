"""The paper's multi-view model behind the project's interface: `open_harmonizer`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from luxcore.errors import InputError
from luxcore.light.agx import agx, agx_inverse
from luxcore.light.exposure import BRACKETS_EV
from luxcore.light.scale_factors import solve
from luxcore.models.diffusion.brackets import merged_light, olat_exposure, olat_picture
from luxcore.models.diffusion.device import pick_device
from luxcore.models.diffusion.exported import exported_folder
from luxcore.models.diffusion.frames import mask_to_tensor, model_size, to_picture, to_tensor
from luxcore.models.diffusion.latents import decode, encode, latent_scale
from luxcore.models.diffusion.options import parse_options
from luxcore.models.interface import (
    MAX_VIEWS_PER_PASS,
    BackendSettings,
    Decomposition,
    Harmonizer,
    Reference,
    View,
)
from luxcore.models.multiview_unet.condition import Condition, latent_mask
from luxcore.models.multiview_unet.rays import plucker_rays
from luxcore.models.multiview_unet.sampling import sample
from luxcore.models.multiview_unet.weights_folder import MODEL, MultiViewModel, open_multiview
from luxcore.settings.paper_models import MultiViewSampling

LATENT_MULTIPLE = 8
"""Sides of the latents are multiples of this: three halvings inside the U-Net."""

Picture = Float[np.ndarray, "h w 3"]


def open_harmonizer(settings: BackendSettings) -> Harmonizer:
    """The model in the folder `mv_weights`; options are those of MultiViewSampling.

    Raises InputError in one sentence when weights or base are absent or unusable.
    """
    sampling = parse_options(MultiViewSampling, dict(settings.options), f"options of {MODEL}")
    folder = exported_folder(settings.mv_weights, MODEL)
    device = pick_device(sampling.device)
    model = open_multiview(folder, sampling.base)
    model.module.to(device)
    model.vae.to(device)
    return MultiViewHarmonizer(model, sampling)


@dataclass(frozen=True)
class MultiViewHarmonizer:
    """Per lamp three exposures of all views, merged to linear light, and one for what remains.

    References come first, so that the first reference is the origin of the rays in every pass.
    A lamp that no reference knows gets no light: nothing says which lamp is meant (`mv-edit` goes
    by the masks instead, and knows every lamp that a view shows).
    """

    model: MultiViewModel
    sampling: MultiViewSampling
    name: str = MODEL

    def run_pass(
        self, views: Sequence[View], references: Sequence[Reference], seed: int
    ) -> list[Decomposition]:
        """See `Harmonizer`. Raises InputError for too many views, or views without a camera."""
        frames = [reference.view for reference in references] + list(views)
        _check(frames)
        if not views:
            return []
        scene = self._scene(frames)
        lamps = range(len(frames[0].on))
        olats = [self._olat(scene, frames, references, lamp, seed) for lamp in lamps]
        ambients = self._ambient(scene, frames, references, seed)
        results = []
        for index, view in enumerate(views, start=len(references)):
            lights = [olat[index] for olat in olats]
            stack = np.stack(lights) if lights else np.zeros((0, *view.image_linear.shape))
            olat = stack.astype(np.float32)
            scale = _scale(view, ambients[index], olat, references)
            results.append(Decomposition(ambients[index], olat, scale))
        return results

    def _scene(self, frames: Sequence[View]) -> Condition:
        """The condition that all exposures of all lamps share: photos and rays."""
        size = self._size(frames)
        latents = self._latents([agx(frame.image_linear) for frame in frames], size)
        cameras = [frame.geometry.camera for frame in frames if frame.geometry is not None]
        rays = plucker_rays(cameras, *latents.shape[-2:])[None].to(latents.device)
        count = len(frames)
        return Condition(
            photo=latents,
            reference=torch.zeros_like(latents),
            is_reference=torch.zeros(1, count, dtype=torch.bool, device=latents.device),
            rays=rays,
            task=torch.zeros(1, device=latents.device),
            present=torch.ones(1, count, dtype=torch.bool, device=latents.device),
        )

    def _olat(
        self,
        scene: Condition,
        frames: Sequence[View],
        references: Sequence[Reference],
        lamp: int,
        seed: int,
    ) -> list[Picture]:
        """One seed for the three exposures, so that they show the same rooms."""
        known = [bool(reference.known[lamp]) for reference in references]
        lights = [r.light.olat[lamp] for r, knows in zip(references, known, strict=True) if knows]
        condition = self._told(scene, frames, [lamp])
        if condition.is_empty and not lights:
            return [np.zeros_like(frame.image_linear) for frame in frames]
        exposure = olat_exposure(lights) if lights else 1.0
        brackets = []
        for exposure_ev in BRACKETS_EV:
            pictures = [olat_picture(light, exposure, exposure_ev) for light in lights]
            brackets.append(self._pictures(condition, frames, known, pictures, seed))
        return [merged_light(views, exposure) for views in zip(*brackets, strict=True)]

    def _ambient(
        self,
        scene: Condition,
        frames: Sequence[View],
        references: Sequence[Reference],
        seed: int,
    ) -> list[Picture]:
        """What remains when every burning lamp is off: the photos themselves if none burns."""
        burning = np.flatnonzero(frames[0].on)
        condition = self._told(scene, frames, burning)
        if not len(burning) or (condition.is_empty and not references):
            return [frame.image_linear for frame in frames]
        condition = replace(condition, task=torch.ones_like(condition.task))
        shown = [agx(reference.light.ambient) for reference in references]
        pictures = self._pictures(condition, frames, [True] * len(shown), shown, seed)
        return [
            np.clip(agx_inverse(picture), 0, frame.image_linear)
            for picture, frame in zip(pictures, frames, strict=True)
        ]

    def _told(
        self, scene: Condition, frames: Sequence[View], lamps: Sequence[int] | np.ndarray
    ) -> Condition:
        """The scene with the masks of `lamps`, where the model goes by masks."""
        if not self.model.module.edits:
            return scene
        size = self._size(frames)
        masks = [mask_to_tensor(frame.masks[list(lamps)].any(0), size) for frame in frames]
        latent_size = (scene.photo.shape[-2], scene.photo.shape[-1])
        stacked = latent_mask(torch.cat(masks)[None], latent_size)
        return replace(scene, light_mask=stacked.to(scene.photo))

    def _pictures(
        self,
        condition: Condition,
        frames: Sequence[View],
        known: Sequence[bool],
        pictures: Sequence[Picture],
        seed: int,
    ) -> list[Picture]:
        """Display pictures of all frames; `pictures` are the lit ones of the known references."""
        if pictures and not self.model.module.edits:
            is_reference = condition.is_reference.clone()
            is_reference[0, : len(known)] = torch.tensor(known)
            reference = condition.reference.clone()
            reference[is_reference] = self._latents(pictures, self._size(frames))[0]
            condition = replace(condition, reference=reference, is_reference=is_reference)
        latents = sample(
            self.model.module, condition, self.sampling.steps, self.sampling.guidance, seed
        )
        made = [decode(self.model.vae, latent[None]) for latent in latents[0]]
        return [
            to_picture(picture, (frame.image_linear.shape[0], frame.image_linear.shape[1]))
            for picture, frame in zip(made, frames, strict=True)
        ]

    def _latents(self, pictures: Sequence[Picture], size: tuple[int, int]) -> Tensor:
        """[1, v, 4, h, w]; one picture at a time, so that 15 views need no more than one."""
        latents = [encode(self.model.vae, to_tensor(picture, size)) for picture in pictures]
        return torch.cat(latents)[None]

    def _size(self, frames: Sequence[View]) -> tuple[int, int]:
        height, width = frames[0].image_linear.shape[:2]
        multiple = LATENT_MULTIPLE * latent_scale(self.model.vae)
        return model_size(height, width, self.sampling.max_area, multiple)


def _check(frames: Sequence[View]) -> None:
    if len(frames) > MAX_VIEWS_PER_PASS:
        raise InputError(
            f"a pass has at most {MAX_VIEWS_PER_PASS} views with references, got {len(frames)}."
        )
    if any(frame.geometry is None for frame in frames):
        raise InputError(f"{MODEL} needs the camera of every view, and a view has none.")


def _scale(
    view: View,
    ambient: Picture,
    olat: Float[np.ndarray, "k h w 3"],
    references: Sequence[Reference],
) -> Float[np.ndarray, "k 3"]:
    """The references' scale factors, the same lamp in the same unit; solved where none knows it."""
    scale = np.zeros((len(view.on), 3), np.float32)
    unsolved = view.on.copy()
    for lamp in np.flatnonzero(view.on):
        known = [reference.light.scale[lamp] for reference in references if reference.known[lamp]]
        if known:
            scale[lamp] = np.mean(known, axis=0)
            unsolved[lamp] = False
    if unsolved.any():
        rest = view.image_linear - np.einsum("kc,khwc->hwc", scale, olat)
        scale[unsolved] = solve(np.maximum(rest, 0), ambient, olat[unsolved])
    return scale
