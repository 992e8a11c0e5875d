"""Settings of the report stage."""

from __future__ import annotations

from luxcore.settings.base import Settings


class ReportSettings(Settings):
    """Knobs of the report stage."""
