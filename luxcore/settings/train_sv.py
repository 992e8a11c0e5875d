"""Settings of the train_sv stage."""

from __future__ import annotations

from luxcore.settings.base import Settings


class TrainSvSettings(Settings):
    """Knobs of the train_sv stage."""
