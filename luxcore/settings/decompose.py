"""Settings of the decompose stage."""

from __future__ import annotations

from pydantic import Field

from luxcore.settings.base import Settings


class DecomposeSettings(Settings):
    """How reference views are taken apart."""

    backend: str = Field("small", description="small, or flux-kontext with weights of your own")
    weights: str | None = Field(
        None, description="weights to use instead of the train_sv stage's: file, folder or hub id"
    )
    references_per_lamp: int = Field(
        1, ge=1, le=4, description="views decomposed for each lamp, best first"
    )
    use_geometry: bool = Field(
        True, description="give the model the depth and normals of stage 1 of the splats"
    )
    options: dict[str, str | int | float | bool] = Field(
        default_factory=dict, description="the backend's own options (small: long_side_px)"
    )
