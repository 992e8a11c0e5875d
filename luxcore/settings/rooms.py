"""Settings of the rooms stage."""

from __future__ import annotations

from luxcore.settings.base import Settings


class RoomsSettings(Settings):
    """Knobs of the rooms stage."""
