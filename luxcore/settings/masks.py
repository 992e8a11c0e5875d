"""Settings of the masks stage: which pixels of which view are which lamp."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from luxcore.settings.base import Settings


class MasksSettings(Settings):
    """How lamps are found and cut out."""

    source: Literal["best", "auto", "truth", "folder"] = "best"
    """best: truth where the capture has it, else auto. folder: the user's NNNN_LL.png files."""

    max_lamps: int = Field(6, ge=1, le=16)
    """Lamps kept at most, strongest first."""

    references: int = Field(3, ge=1, le=16)
    """Reference views listed per lamp, best first."""

    min_area: float = Field(4e-5, gt=0, lt=0.1)
    """Smallest lamp, as a fraction of the picture's pixels."""

    max_area: float = Field(0.06, gt=0, le=1)
    """Largest lamp, as a fraction of the picture's pixels: larger bright areas are windows."""
