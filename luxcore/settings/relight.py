"""Settings of the relight stage: radiance per lamp on every Gaussian (stage 2 of the splats)."""

from __future__ import annotations

from pydantic import Field

from luxcore.settings.base import Settings


class RelightSettings(Settings):
    """Knobs of stage 2. The defaults are the embedded profile; the paper's numbers are named."""

    joint_iterations: int = Field(
        200, ge=0, le=1_000_000, description="steps of geometry and light together; paper: 4000"
    )
    frozen_iterations: int = Field(
        150, ge=0, le=1_000_000, description="steps of light on frozen geometry; paper: 2000"
    )
    max_side: int = Field(
        1600, ge=16, le=16_384, description="longer images are shrunk to this many pixels"
    )
    ssim_weight: float = Field(0.2, ge=0, le=10, description="λ of D-SSIM beside L1, per light")
    composition_weight: float = Field(
        0.5, ge=0, le=100, description="λ_comp: recombined lights against the photo"
    )
    smoothness_weight: float = Field(
        1.0, ge=0, le=1000, description="λ_smooth: lights of neighbouring Gaussians alike"
    )
    smoothness_every: int = Field(
        50, ge=1, le=100_000, description="frozen iterations between smoothness terms; paper: 100"
    )
    neighbors: int = Field(8, ge=1, le=64, description="K of the smoothness term")
    light_rate: float = Field(
        0.01, gt=0, le=1, description="step of radiance, in units of twice a light's mean"
    )
    weight_rate: float = Field(
        0.001, ge=0, le=1, description="step of the lamps' scale factors and of the tone curve"
    )
    geometry_rate_scale: float = Field(
        1.0, gt=0, le=100, description="multiplies 3DGS's learning rates in the joint phase"
    )
    holdout_every: int = Field(
        8, ge=2, le=1000, description="one view in this many is not trained on but measured"
    )
    curve_every: int = Field(
        100, ge=1, le=100_000, description="iterations between measurements of the held-out views"
    )
    checkpoint_every: int = Field(
        250, ge=1, le=1_000_000, description="iterations between checkpoints a kill can resume from"
    )
    max_baked_mb: int = Field(
        4096, ge=0, le=1_000_000, description="memory for cached blending weights; 0 caches none"
    )
