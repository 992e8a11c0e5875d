"""Do two views agree on a lamp's light? One view's light is warped into the other by true depth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
import torch.nn.functional as fn
from jaxtyping import Float

from luxcore.data.crops import LitCrop
from luxcore.light.agx import agx
from luxcore.metrics.image import psnr
from luxcore.models.small.multiview import correspondence
from luxcore.models.small.samples import chw
from luxcore.models.small.surfaces import surfaces_of

MIN_PIXELS = 50


def warped(
    source: LitCrop, lights: Float[np.ndarray, "k h w 3"], target: LitCrop
) -> Float[np.ndarray, "k h w 3"]:
    """Light of `source` at the places that `target` sees; black where `source` sees nothing."""
    moved, visible = _moved(source, lights, target)
    return moved * visible[..., None]


def consistency_db(source: LitCrop, target: LitCrop, lamps: Sequence[int]) -> list[float]:
    """PSNR in dB, per lamp, between the target's lights and the source's warped into it, on AgX
    images of the commonly seen places. Empty where the views have too little in common."""
    moved, visible = _moved(source, source.lights, target)
    if int(visible.sum()) < MIN_PIXELS:
        return []
    exposure = np.float32(target.exposure)
    values = []
    for k in lamps:
        shown = (agx(light * exposure)[visible] for light in (moved[k], target.lights[k]))
        values.append(psnr(*shown))
    return values


def _moved(
    source: LitCrop, lights: Float[np.ndarray, "k h w 3"], target: LitCrop
) -> tuple[np.ndarray, np.ndarray]:
    here = surfaces_of(target.depth_m, target.normal, target.camera)
    there = surfaces_of(source.depth_m, source.normal, source.camera)
    grid, weight = correspondence(here, target.camera, there, source.camera)
    planes = chw(lights)
    moved = fn.grid_sample(planes, grid.expand(len(planes), -1, -1, -1), align_corners=False)
    visible = weight > 0
    return np.ascontiguousarray(torch.movedim(moved, 1, -1).numpy()), visible.numpy()
