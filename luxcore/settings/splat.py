"""Settings of the splat stage: geometry from photos (stage 1 of the splats)."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from luxcore.settings.base import Settings


class SplatSettings(Settings):
    """Knobs of stage 1. The defaults are the embedded profile: small captures in about a minute."""

    iterations: int = Field(800, ge=0, le=1_000_000, description="optimization steps of one view")
    max_side: int = Field(
        1600, ge=16, le=16_384, description="longer photos are shrunk to this many pixels"
    )
    initial_gaussians: int = Field(
        12_000, ge=1, le=10_000_000, description="points of the capture to start from, at most"
    )
    max_gaussians: int = Field(
        24_000, ge=1, le=10_000_000, description="density control adds no more than this many"
    )
    density: Literal["standard", "mcmc"] = Field(
        "standard", description="how Gaussians are added and removed"
    )
    ssim_weight: float = Field(
        0.2, ge=0, le=1, description="share of D-SSIM in the loss; the rest is L1"
    )
    sh_degree: int | None = Field(
        None,
        ge=0,
        le=3,
        description="degree of the spherical harmonics; null asks the residuals whether 1 earns it",
    )
    antialiased: bool = Field(False, description="low-pass compensation of Mip-Splatting")
    rate_scale: float = Field(
        3.0, gt=0, le=100, description="multiplies all learning rates of 3DGS; long runs want 1"
    )
    holdout_every: int = Field(
        8, ge=2, le=1000, description="one view in this many is not trained on but measured"
    )
    curve_every: int = Field(
        200, ge=1, le=100_000, description="iterations between measurements of the held-out views"
    )
    checkpoint_every: int = Field(
        500, ge=1, le=1_000_000, description="iterations between checkpoints a kill can resume from"
    )
