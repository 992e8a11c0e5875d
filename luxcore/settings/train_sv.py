"""Settings of the train_sv stage."""

from __future__ import annotations

from pydantic import Field

from luxcore.settings.base import Settings


class TrainingSettings(Settings):
    """A fine-tuning run of a small model, from the shipped weights or from scratch."""

    steps: int = Field(24, ge=0, le=1_000_000, description="optimizer steps; 0 keeps the base")
    photos_per_step: int = Field(4, ge=1, le=256, description="photos, with all their lamps")
    rooms: int = Field(
        0, ge=0, description="only the first so many rendered rooms; 0 takes all there are"
    )
    groups: int = Field(12, ge=1, le=100_000, description="groups of photos cut from the renders")
    views_per_group: int = Field(3, ge=2, le=15, description="overlapping photos in a group")
    sketches: int = Field(
        0, ge=0, le=100_000, description="groups of sketched rooms mixed in, a second each"
    )
    size_px: int = Field(96, ge=32, le=512, multiple_of=16, description="side of a photo")
    rate: float = Field(3e-4, gt=0, le=0.1, description="peak learning rate of AdamW")
    cooldown: float = Field(0.5, ge=0, le=1, description="share of steps in which it falls to 0")
    check_every: int = Field(24, ge=1, description="steps between scores on validation photos")
    validation_groups: int = Field(
        2, ge=1, le=1000, description="groups kept aside; of other rooms where there are enough"
    )
    base: str | None = Field(
        "shipped", description='"shipped", a safetensors file, or null to start from scratch'
    )
    blend: float = Field(
        1.0,
        gt=0,
        le=1,
        description="share of the trained weights in what is written; the rest is the base's",
    )


class TrainSvSettings(TrainingSettings):
    """Knobs of the train_sv stage."""

    geometry_share: float = Field(
        0.35, ge=0, le=1, description="share of photos given with depth and normals"
    )
