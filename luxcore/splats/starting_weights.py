"""The lamps' scale factors to start from: with them the light images add up to the photos."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float32

from luxcore.light.agx import agx_inverse
from luxcore.light.scale_factors import solve
from luxcore.splats.light_views import LightViews

_PIXELS = 40_000
"""Pixels looked at over all views; scale factors are 3 numbers a lamp."""


def starting_weights(
    views: LightViews, training: Sequence[int], on: Sequence[bool], exposure: float
) -> Float32[np.ndarray, "m 3"]:
    """w [m, 3], ambient first: 1 for ambient, 0 for lamps that were off, else least squares.

    Light images may come in any unit (those of a model are of a lamp at full power), and a fit by
    small steps from 1 would not reach a factor of thirty.
    """
    weights = np.zeros((len(on) + 1, 3), np.float32)
    weights[0] = 1
    shone = [index + 1 for index, lit in enumerate(on) if lit]
    if shone and len(training):
        photo, lights = _pooled(views, training, exposure)
        found = solve(photo, lights[0], lights[shone])
        # Nothing found means nothing is known: as the images are.
        weights[shone] = np.where(found.any(axis=1, keepdims=True), found, 1)
    return weights


def _pooled(
    views: LightViews, training: Sequence[int], exposure: float
) -> tuple[np.ndarray, np.ndarray]:
    """_PIXELS pixels of all views, the same every time: photo [1, p, 3] and lights [m, 1, p, 3],
    exposed."""
    total = sum(views.photos[v].size // 3 for v in training)
    random = np.random.Generator(np.random.PCG64(0))
    photos, lights = [], []
    for view in training:
        photo = views.photos[view].get().reshape(-1, 3)
        # At random: every k-th pixel would be the same few columns of each row.
        count = min(len(photo), -(-len(photo) * _PIXELS // total))
        chosen = np.sort(random.choice(len(photo), count, replace=False))
        photos.append(photo[chosen])
        pixels = views.targets[view].get().reshape(-1, len(views.units), 3)[chosen]
        lights.append(pixels * (views.units * np.float32(exposure))[:, None])
    photo = agx_inverse(np.concatenate(photos)).astype(np.float32)
    return photo[None], np.moveaxis(np.concatenate(lights), 1, 0)[:, None]
