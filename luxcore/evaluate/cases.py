"""Held-out photos with known light, one for each lamp of each room."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from luxcore.data.crops import LitCrop, with_lamps
from luxcore.data.store import AnyView, ViewStore
from luxcore.data.training import aimed_crop, generator, lamps_in_sight
from luxcore.light.agx import agx, agx_inverse
from luxcore.light.exposure import estimate_exposure
from luxcore.models.interface import Geometry, View

ATTEMPTS_PER_LAMP = 6
MASK_KIND = "fixture"


@dataclass(frozen=True)
class LampCase:
    """A photo and one of its lamps, whose light is asked for. `crop.on[lamp]` may be false."""

    scene: str
    crop: LitCrop
    lamp: int

    @property
    def truth(self) -> Float[np.ndarray, "h w 3"]:
        """The lamp's own light, linear radiance."""
        return self.crop.lights[self.lamp]


def single_cases(
    views: Sequence[AnyView], size_px: int, seed: int, *, on: bool, limit: int
) -> list[LampCase]:
    """One photo for each (panorama, lamp) of `views` that can be seen, the lamp on or off in it.

    The other lamps are as rendered. With the lamp off, the photo keeps the exposure that it has
    with the lamp on: a camera on a tripod. At most `limit` cases, in the order of the panoramas.
    """
    store = ViewStore(views)
    cases: list[LampCase] = []
    for number in range(len(store)):
        rng = generator(seed, 7, number)
        source = store.source(number)
        found: set[int] = set()
        for _ in range(ATTEMPTS_PER_LAMP * len(source.view.lamps)):
            crop, target = aimed_crop(source, rng, (size_px, size_px), MASK_KIND)
            if target is None or target in found or not crop.masks[target].any():
                continue
            found.add(target)
            cases.append(_case(source.view.room, crop, target, on))
        if len(cases) >= limit:
            break
    return cases[:limit]


def photo_of(crop: LitCrop) -> Float[np.ndarray, "h w 3"]:
    """What an 8-bit AgX photo tells of the crop's light, in units where the exposure is 1."""
    shown = np.asarray(agx(crop.image_linear * np.float32(crop.exposure)))
    return np.asarray(agx_inverse(np.round(shown * 255) / 255), np.float32)


def radiance_of(crop: LitCrop) -> Float[np.ndarray, "h w 3"]:
    """The same as linear radiance, as lamps' own lights are: `photo_of` without the exposure."""
    return photo_of(crop) / np.float32(crop.exposure)


def view_of(crop: LitCrop, *, geometry: bool) -> View:
    """A crop as the models take it, its photo clipped and rounded as a camera's."""
    known = Geometry(crop.camera, crop.depth_m, crop.normal) if geometry else None
    return View(photo_of(crop), crop.masks, crop.on, known)


def _case(scene: str, crop: LitCrop, target: int, on: bool) -> LampCase:
    burning = crop.on.copy()
    burning[target] = True
    exposure = estimate_exposure(replace(crop, on=burning).image_linear)
    burning[target] = on
    seen = lamps_in_sight(crop.masks, target)
    kept = [target, *(i for i in seen if i != target)]
    lit = with_lamps(replace(crop, on=burning, exposure=exposure), kept)
    return LampCase(scene, lit, 0)
