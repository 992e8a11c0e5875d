"""Settings of the capture stage: photos to poses, points and undistorted views."""

from __future__ import annotations

from pydantic import Field

from luxcore.settings.base import Settings


class CaptureSettings(Settings):
    """How photos become a capture."""

    image_side: int = Field(1024, ge=64, le=8192)
    """Longest side of the stored photos, pixels; larger photos are reduced before all else."""

    features: int = Field(4096, ge=256, le=32_768)
    """SIFT features per photo at most."""

    exhaustive_up_to: int = Field(100, ge=2, le=1000)
    """Up to this many photos every pair is matched; above, each photo with its neighbours."""

    neighbours: int = Field(12, ge=2, le=100)
    """Photos before and after, in name order, that a photo is matched with in a long series."""

    min_views: int = Field(3, ge=2)
    """Fewer placed views than this are an error."""

    min_placed: float = Field(0.5, ge=0, le=1)
    """A smaller fraction of the photos placed is an error."""

    points: int = Field(60_000, ge=100, le=5_000_000)
    """Points taken from the depth of a rendered room at most; SfM points are all kept."""
