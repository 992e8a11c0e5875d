"""Settings of the evaluate stage."""

from __future__ import annotations

from pydantic import Field

from luxcore.settings.base import Settings


class EvaluateSettings(Settings):
    """What is scored, and how much of it."""

    backend: str = Field("small", description="single-view backend that is scored")
    mv_backend: str = Field("small", description="multi-view backend that is scored")
    cases: int = Field(
        6, ge=1, le=10_000, description="(panorama, lamp) cases with the lamp on, and again off"
    )
    size_px: int = Field(128, ge=32, le=1024, description="side of a case's photo")
    groups: int = Field(
        1, ge=0, le=10_000, description="groups of views cut from the test rooms' panoramas"
    )
    views_per_group: int = Field(4, ge=2, le=15, description="views of such a group")
    capture_views: int = Field(
        4, ge=2, le=15, description="views of each capture with truth, its first reference included"
    )
    capture_side_px: int = Field(256, ge=32, le=4096, description="long side they are scored at")
    options: dict[str, str | int | float | bool] = Field(
        default_factory=dict, description="the backends' own options (small: long_side_px)"
    )
