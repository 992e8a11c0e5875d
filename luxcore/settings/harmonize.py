"""Settings of the harmonize stage."""

from __future__ import annotations

from luxcore.settings.base import Settings


class HarmonizeSettings(Settings):
    """Knobs of the harmonize stage."""
