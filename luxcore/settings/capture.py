"""Settings of the capture stage: photos to poses, points and undistorted views."""

from __future__ import annotations

from pydantic import Field

from luxcore.settings.base import Settings


class CaptureSettings(Settings):
    """How photos become a capture."""

    image_side: int = Field(
        1024, ge=64, le=8192, description="longest side of stored photos, pixels; larger are shrunk"
    )
    features: int = Field(
        4096, ge=256, le=32_768, description="SIFT features of one photo, at most"
    )
    exhaustive_up_to: int = Field(
        100,
        ge=2,
        le=1000,
        description="up to this many photos every pair is matched; above, only neighbours",
    )
    neighbours: int = Field(
        12, ge=2, le=100, description="photos after it, by name, that one in a long series meets"
    )
    min_views: int = Field(3, ge=2, le=1000, description="fewer placed views are an error")
    min_placed: float = Field(
        0.5, ge=0, le=1, description="a smaller fraction of the photos placed is an error"
    )
    points: int = Field(
        60_000,
        ge=100,
        le=5_000_000,
        description="points taken from the depth of a rendered room, at most; SfM's are all kept",
    )
