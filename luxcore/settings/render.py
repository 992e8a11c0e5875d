"""Settings of the render stage."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from luxcore.settings.base import Settings


class RenderSettings(Settings):
    """How rooms become light-group images. Thread count and machines are never settings."""

    height: int = Field(128, ge=16, le=4096, description="rows of a panorama; columns are twice")
    spp: int = Field(10, ge=1, le=4096, description="samples per pixel of a light-group render")
    views_per_room: int = Field(1, ge=1, le=4, description="panoramas a room (the paper: 4)")
    denoise: Literal["off", "fast", "balanced", "high"] = Field(
        "balanced", description="quality of the denoiser, run on every light by itself"
    )
    top_up_noise: float = Field(
        1.8, gt=0, description="relative noise above which the worst lamp is rendered once more"
    )
    top_up_factor: int = Field(
        3, ge=1, le=64, description="samples of that second render, in units of spp"
    )
    demo_views: int = Field(24, ge=2, le=200, description="perspective views of the demo capture")
    demo_width: int = Field(320, ge=32, le=4096, description="columns of a demo view, pixels")
    demo_height: int = Field(240, ge=32, le=4096, description="rows of a demo view, pixels")
    demo_fov_deg: float = Field(72.0, gt=20, lt=120, description="horizontal field of view")
    demo_spp: int = Field(8, ge=1, le=4096, description="samples per pixel of a demo view")
    timeout_s: float = Field(900.0, gt=0, description="a view that takes longer is quarantined")
    memory_mb: int = Field(
        8000, ge=1000, description="address space of the renderer; a view that needs more fails"
    )
    max_failed_ratio: float = Field(
        0.1, ge=0, le=1, description="share of views that may fail before the stage does"
    )
