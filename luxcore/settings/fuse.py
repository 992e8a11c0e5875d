"""Settings of the fuse stage."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from luxcore.settings.base import Settings

Method = Literal["debevec", "direct"]


class FuseSettings(Settings):
    """How each lamp's exposures become linear light."""

    method: Method = Field(
        "debevec",
        description="debevec: merge the three 8-bit exposures of each light, as the paper does; "
        "direct: take the linear light of a model that gives it",
    )
