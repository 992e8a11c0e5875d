"""Settings of the render stage."""

from __future__ import annotations

from luxcore.settings.base import Settings


class RenderSettings(Settings):
    """Knobs of the render stage."""
