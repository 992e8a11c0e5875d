"""Σ w·L of every Gaussian, tone-mapped: the one colour that the browser draws it with.

Tone-mapping each Gaussian and then blending is not tone-mapping the blended image: soft edges come
out a little brighter. The exact picture does it in the right order; the page says which is shown.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from jaxtyping import Float, UInt8

from luxcore.light.agx import agx, srgb_encode
from luxcore.viewer.lighting import Tone

CHUNK = 25_000
"""Gaussians per task: the temporary arrays of AgX stay in the cache."""


def tone_map(
    radiance: Float[np.ndarray, "*s 3"], gain: float, tone: Tone
) -> Float[np.ndarray, "*s 3"]:
    """Display values in 0..1 of linear Rec.709 radiance times `gain`."""
    exposed = np.asarray(radiance * np.float32(gain), np.float32)
    if tone == "AgX":
        return agx(exposed)
    return srgb_encode(np.clip(exposed, 0.0, 1.0))


class Colours:
    """Lights of a scene, laid out so that a change of lighting is one pass over memory."""

    def __init__(self, radiance: Float[np.ndarray, "n m 3"]) -> None:
        # Channel first, lights last: one matrix-vector product per channel.
        self._lights = np.ascontiguousarray(radiance.transpose(2, 0, 1), np.float32)
        self._threads = ThreadPoolExecutor(2, "colours")

    def mixed(
        self, weights: Float[np.ndarray, "m 3"], gain: float, tone: Tone
    ) -> UInt8[np.ndarray, "n 3"]:
        """sRGB-encoded 8-bit colours for `weights` (ambient first)."""
        count = self._lights.shape[1]
        colours = np.empty((count, 3), np.uint8)

        def mix(start: int) -> None:
            chunk = self._lights[:, start : start + CHUNK]
            linear = np.stack([chunk[c] @ weights[:, c] for c in range(3)], axis=1)
            display = tone_map(linear, gain, tone)
            colours[start : start + CHUNK] = np.round(display * 255.0)

        list(self._threads.map(mix, range(0, count, CHUNK)))
        return colours
