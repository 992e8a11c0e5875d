"""How much a bright region looks like a lamp: one number from its cues.

The weights were set by hand so that lamps stand above windows, sunlit edges, screens and white
objects in photos of offices, bedrooms, a kitchen, a garage and an atrium. They are not learnt.
"""

from __future__ import annotations

import numpy as np

from luxcore.masks.blobs import Blob

SURE = 4.75
"""The best region of a room must reach this, else the room shows no lamp."""

BELOW_BEST = 0.9
"""Other regions count as lamps when they are at most this much less lamp-like than the best."""

PLENTY = 6.9
"""A still more lamp-like best region does not raise what is asked of the others."""

WINDOW_AREA = 0.01
"""Fraction of the picture above which a bright region is more and more likely a window."""


def lampness(blob: Blob, elevation_deg: float) -> float:
    """About 6 for a lamp with a visible glow, below 4.5 for most other bright things.

    `elevation_deg` is the angle above the horizon under which the camera sees the region.
    """
    cues = blob.cues
    shape = 3 * (cues.solidity - 0.8) + 8 * (min(cues.edge, 0.12) - 0.06) - 0.7 * cues.sides_cut
    light = (
        21 * (min(cues.core, 0.97) - 0.9)
        + 0.45 * min(cues.contrast_stops, 6)
        + 0.8 * np.clip(cues.glow_stops, -0.5, 2)
        + 0.35 * np.clip(cues.surround_stops, -3, 2.5)
        # A lamp that clips to white looks cooler than the room it lights: that is held against it
        # only as far as it helps against skylights.
        + 6 * np.clip(cues.warmth, -0.05, 0.2)
    )
    # Bright things on floors and low tables are mostly lit, not lamps.
    low = 2.5 * np.clip((-10 - elevation_deg) / 30, 0, 1)
    size = 0.25 * min(np.log2(blob.area / 1e-3), 2)
    window = 3 * np.clip((blob.area - WINDOW_AREA) / 0.02, 0, 1)
    return float(shape + light + size - low - window)


def needed(best: float) -> float:
    """The lampness that a region must have in a room whose best region has `best`.

    Infinite where the best is not lamp-like enough for the room to have any.
    """
    return min(best, PLENTY) - BELOW_BEST if best >= SURE else np.inf
