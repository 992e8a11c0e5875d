"""Settings of the harmonize stage."""

from __future__ import annotations

from pydantic import Field

from luxcore.settings.base import Settings


class HarmonizeSettings(Settings):
    """How the references' light is carried to all views."""

    backend: str = Field("small", description="small, or multiview-unet with weights of your own")
    weights: str | None = Field(
        None, description="weights to use instead of the train_mv stage's: file, folder or hub id"
    )
    views_per_pass: int = Field(
        15, ge=2, le=15, description="views, references included, that one pass holds"
    )
    chain: bool = Field(
        True, description="take the nearest finished view along as a second reference"
    )
    use_geometry: bool = Field(
        True, description="warp the references' light by the depth of stage 1 of the splats"
    )
    options: dict[str, str | int | float | bool] = Field(
        default_factory=dict, description="the backend's own options (small: long_side_px)"
    )
