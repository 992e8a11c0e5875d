"""Settings of the evaluate stage."""

from __future__ import annotations

from luxcore.settings.base import Settings


class EvaluateSettings(Settings):
    """Knobs of the evaluate stage."""
