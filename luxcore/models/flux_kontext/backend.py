"""The paper's single-view model behind the project's interface: `open_decomposer`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float

from luxcore.light.agx import agx, agx_inverse
from luxcore.light.scale_factors import solve
from luxcore.models.diffusion.brackets import merged_light
from luxcore.models.diffusion.device import pick_device
from luxcore.models.diffusion.exported import exported_folder
from luxcore.models.diffusion.frames import mask_to_tensor, model_size, to_picture, to_tensor
from luxcore.models.diffusion.options import parse_options
from luxcore.models.flux_kontext.prompts import Brightness, LightKind, LightOffPrompt, OlatPrompt
from luxcore.models.flux_kontext.weights_folder import MODEL, TrainedEditor, open_editor
from luxcore.models.interface import BackendSettings, Decomposer, Decomposition, Geometry
from luxcore.settings.paper_models import KontextSampling


def open_decomposer(settings: BackendSettings) -> Decomposer:
    """The model in the folder `sv_weights`; options are those of KontextSampling.

    Raises InputError in one sentence when weights or base are absent or unusable.
    """
    sampling = parse_options(KontextSampling, dict(settings.options), f"options of {MODEL}")
    folder = exported_folder(settings.sv_weights, MODEL)
    device = pick_device(sampling.device)
    # Half precision on a CPU is slower, not smaller where it matters.
    dtype = torch.bfloat16 if device.type == "cuda" else torch.float32
    trained = open_editor(folder, sampling.base, dtype)
    trained.editor.module.to(device)
    trained.editor.vae.to(device)
    return KontextDecomposer(trained, sampling)


@dataclass(frozen=True)
class KontextDecomposer:
    """Per lamp three edits, merged to linear light, and one more for a lamp that burns.

    Geometry is not used. Light finer than the model's resolution is lost in `olat` and `ambient`.
    """

    trained: TrainedEditor
    sampling: KontextSampling
    name: str = MODEL

    def decompose(
        self,
        image_linear: Float[np.ndarray, "h w 3"],
        masks: Bool[np.ndarray, "k h w"],
        on: Bool[np.ndarray, " k"],
        geometry: Geometry | None,
        seed: int,
    ) -> Decomposition:
        """See `Decomposer`. An OLAT is in the model's own unit: its scale factor says how much of
        it the photo holds."""
        seen = masks.any((1, 2))
        olat = np.zeros((len(masks), *image_linear.shape), np.float32)
        for lamp in np.flatnonzero(seen):
            olat[lamp] = self._olat(image_linear, masks[lamp], seed)
        burning = on & seen
        ambient = self._ambient(image_linear, masks[burning], seed)
        scale = np.zeros((len(masks), 3), np.float32)
        if burning.any():
            scale[burning] = solve(image_linear, ambient, olat[burning])
        return Decomposition(ambient, olat, scale)

    def _olat(
        self,
        image_linear: Float[np.ndarray, "h w 3"],
        mask: Bool[np.ndarray, "h w"],
        seed: int,
    ) -> Float[np.ndarray, "h w 3"]:
        """One seed for the three brightness levels, so that they show the same room."""
        kind, shown = LightKind(self.sampling.light_kind), agx(image_linear)
        prompts = [OlatPrompt(kind, brightness) for brightness in Brightness]
        return merged_light([self._edited(shown, mask, prompt, seed) for prompt in prompts])

    def _ambient(
        self,
        image_linear: Float[np.ndarray, "h w 3"],
        masks: Bool[np.ndarray, "k h w"],
        seed: int,
    ) -> Float[np.ndarray, "h w 3"]:
        """One burning lamp after the other switched off; taking light away brightens no pixel."""
        if not len(masks):
            return image_linear
        prompt = LightOffPrompt(LightKind(self.sampling.light_kind))
        shown = agx(image_linear)
        for mask in masks:
            shown = self._edited(shown, mask, prompt, seed)
        return np.clip(agx_inverse(shown), 0, image_linear)

    def _edited(
        self,
        shown: Float[np.ndarray, "h w 3"],
        mask: Bool[np.ndarray, "h w"],
        prompt: OlatPrompt | LightOffPrompt,
        seed: int,
    ) -> Float[np.ndarray, "h w 3"]:
        editor, size = self.trained.editor, (shown.shape[0], shown.shape[1])
        inner = model_size(*size, self.sampling.max_area, editor.multiple)
        picture = editor.edit(
            to_tensor(shown, inner),
            mask_to_tensor(mask, inner),
            prompt,
            self.trained.embeddings,
            self.sampling,
            seed,
        )
        return to_picture(picture, size)
