"""Settings of the relight stage."""

from __future__ import annotations

from luxcore.settings.base import Settings


class RelightSettings(Settings):
    """Knobs of the relight stage."""
