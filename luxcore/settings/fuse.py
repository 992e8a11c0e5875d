"""Settings of the fuse stage."""

from __future__ import annotations

from luxcore.settings.base import Settings


class FuseSettings(Settings):
    """Knobs of the fuse stage."""
