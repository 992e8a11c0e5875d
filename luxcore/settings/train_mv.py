"""Settings of the train_mv stage."""

from __future__ import annotations

from luxcore.settings.base import Settings


class TrainMvSettings(Settings):
    """Knobs of the train_mv stage."""
