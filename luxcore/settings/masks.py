"""Settings of the masks stage: which pixels of which view are which lamp."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from luxcore.settings.base import Settings


class MasksSettings(Settings):
    """How lamps are found and cut out."""

    source: Literal["best", "auto", "truth"] = Field(
        "best", description="best: the user's masks, else the truth, else found in the photos"
    )
    max_lamps: int = Field(6, ge=1, le=16, description="lamps kept, strongest first")
    references: int = Field(3, ge=1, le=16, description="reference views named per lamp")
    min_area: float = Field(
        4e-5, gt=0, lt=0.1, description="smallest lamp, as a fraction of the picture's pixels"
    )
    max_area: float = Field(
        0.06, gt=0, le=1, description="largest lamp, as a fraction; larger bright areas are windows"
    )
