"""Settings of the rooms stage."""

from __future__ import annotations

from pydantic import Field

from luxcore.settings.base import Settings

TEST_SEED_BASE = 900_000
"""Rooms from this seed on are held out: training never draws them."""

DEMO_SEED_BASE = 990_000
"""From here on rooms are neither training nor test rooms: the demo capture is one of them."""


class RoomsSettings(Settings):
    """How many rooms, and what may be in them."""

    train: int = Field(3, ge=0, le=TEST_SEED_BASE, description="training rooms")
    test: int = Field(1, ge=0, le=DEMO_SEED_BASE - TEST_SEED_BASE, description="held-out rooms")
    first_seed: int = Field(
        0, ge=0, lt=TEST_SEED_BASE, description="seed of the first training room"
    )
    demo_seed: int = Field(
        990_029, ge=DEMO_SEED_BASE, lt=10**6, description="seed of the demo room"
    )
    demo_lamps: int = Field(3, ge=1, le=6, description="lamps of the demo room, all on")
    max_lamps: int = Field(6, ge=1, le=6, description="controllable lamps a room (the paper: 6)")
    off_probability: float = Field(
        0.2, ge=0, le=1, description="chance that a lamp is off in the input photo"
    )
    hdri_folder: str = Field(
        "", description="folder of .exr or .hdr environments; empty: Blender's own"
    )
