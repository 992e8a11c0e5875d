"""Settings of the train_mv stage."""

from __future__ import annotations

from luxcore.settings.train_sv import TrainingSettings


class TrainMvSettings(TrainingSettings):
    """Knobs of the train_mv stage."""
