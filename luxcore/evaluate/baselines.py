"""What a lamp's light would be by simple means; each is a floor that a model must clear.

All return linear radiance, whose scale a method without a model can only take from the photo.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from luxcore.evaluate.cases import LampCase, radiance_of

Baseline = Callable[[LampCase], Float[np.ndarray, "h w 3"]]


def copy_input(case: LampCase) -> Float[np.ndarray, "h w 3"]:
    """The photo itself."""
    return radiance_of(case.crop)


def flat_colour(case: LampCase) -> Float[np.ndarray, "h w 3"]:
    """One colour everywhere, the photo's mean: the rescale makes it the best one."""
    return np.broadcast_to(radiance_of(case.crop).mean((0, 1)), case.truth.shape)


def mask_falloff(case: LampCase) -> Float[np.ndarray, "h w 3"]:
    """The photo times 1/(1 + (r/r0)²) around the mask, r0 a fifth of the picture."""
    mask = case.crop.masks[case.lamp]
    rows, columns = np.mgrid[: mask.shape[0], : mask.shape[1]]
    y, x = rows[mask].mean(), columns[mask].mean()
    squared = ((rows - y) ** 2 + (columns - x) ** 2) / (0.2 * max(mask.shape)) ** 2
    return (radiance_of(case.crop) / (1 + squared[..., None])).astype(np.float32)


def lambert(case: LampCase) -> Float[np.ndarray, "h w 3"]:
    """The photo times cos/d² from the lamp's true place: geometry known, shadows not."""
    crop, mask = case.crop, case.crop.masks[case.lamp]
    points = _world_points(case)
    offset = points[mask].mean(axis=0) - points
    distance = np.maximum(np.linalg.norm(offset, axis=2), 0.1)
    cosine = np.maximum((offset * crop.normal).sum(2) / distance, 0)
    falloff = np.where(mask, 1 / 0.1, cosine / distance**2)
    return (radiance_of(crop) * falloff[..., None]).astype(np.float32)


BASELINES: dict[str, Baseline] = {
    "copy the input": copy_input,
    "best flat colour": flat_colour,
    "mask falloff": mask_falloff,
    "Lambert, true geometry": lambert,
}


def _world_points(case: LampCase) -> np.ndarray:
    crop, camera = case.crop, case.crop.camera
    x = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    y = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
    grid = np.meshgrid(x, y)
    rays = np.stack([*grid, np.ones_like(grid[0])], axis=2) * crop.depth_m[..., None]
    return rays @ camera.c2w[:3, :3].T + camera.centre
