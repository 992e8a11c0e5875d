"""Settings of the fuse stage."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from luxcore.settings.base import Settings

Method = Literal["debevec", "direct"]


class FuseSettings(Settings):
    """How each lamp's exposures become linear light."""

    method: Method = Field(
        "direct",
        description="direct: take the model's own linear light; debevec: merge the three 8-bit "
        "exposures of each light, as the paper does",
    )
    merge_every: int = Field(
        6,
        ge=1,
        description="with direct: every so many views the exposures are merged as well, and the "
        "difference reported",
    )
