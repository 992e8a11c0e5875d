"""Settings of the decompose stage."""

from __future__ import annotations

from luxcore.settings.base import Settings


class DecomposeSettings(Settings):
    """Knobs of the decompose stage."""
