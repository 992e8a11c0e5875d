"""Settings of the splat stage."""

from __future__ import annotations

from luxcore.settings.base import Settings


class SplatSettings(Settings):
    """Knobs of the splat stage."""
