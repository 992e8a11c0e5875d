"""One browser tab: its camera, whether it shows the exact picture, its keyframes."""

from __future__ import annotations

from typing import Any

import numpy as np

from luxcore.cameras import Camera

MAX_PIXELS = 800_000
"""Size of an exact picture; a larger tab shows it enlarged."""
FAST = (
    "**Fast preview**: each splat is tone-mapped before blending, "
    "so soft edges are a little too bright."
)
EXACT = "**Exact picture**: light is blended first and tone-mapped once."

BLACK = np.zeros((1, 1, 3), np.uint8)
"""Behind the splats; the viewer's own background is grey, which light never is here."""


class Tab:
    """What the server keeps of one connected browser."""

    def __init__(self, client: Any) -> None:
        self.client = client
        self.keyframes: list[Camera] = []
        self.status = client.gui.add_markdown(FAST, order=-10.0)
        self._covered = True
        self.show_fast()

    def show_exact(self, display: np.ndarray) -> None:
        """Cover the splats with a picture of the same view."""
        pixels = np.round(np.clip(display, 0, 1) * 255).astype(np.uint8)
        # Depth 0 everywhere: the picture stands before every splat.
        nearest = np.zeros(pixels.shape[:2], np.float32)
        self.client.scene.set_background_image(pixels, format="png", depth=nearest)
        self.status.content = EXACT
        self._covered = True

    def show_fast(self) -> None:
        """Uncover the splats."""
        if self._covered:
            self._covered = False
            self.client.scene.set_background_image(BLACK)
            self.status.content = FAST
