"""How a picture's values follow from light: AgX, or a camera's own curve per channel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float


@runtime_checkable
class Response(Protocol):
    """The inverse of a tone curve."""

    def linear(self, display: Float[np.ndarray, "h w 3"]) -> Float[np.ndarray, "h w 3"]:
        """Exposure (radiance times time) up to a common factor, of display values in 0..1."""
        ...


@dataclass(frozen=True)
class AgxResponse:
    """Pictures made with AgX. Its channels depend on each other, so it has no curve per channel."""

    def linear(self, display: Float[np.ndarray, "h w 3"]) -> Float[np.ndarray, "h w 3"]:
        # Brackets of a camera do without, and torch, which AgX brings, takes seconds to load.
        from luxcore.light.agx import agx_inverse

        return agx_inverse(display)


@dataclass(frozen=True)
class CurveResponse:
    """A camera's curve: `exposure[v, c]` for 8-bit value v of channel c, rising, any scale."""

    exposure: Float[np.ndarray, "256 3"]

    def linear(self, display: Float[np.ndarray, "h w 3"]) -> Float[np.ndarray, "h w 3"]:
        values = np.arange(256.0)
        planes = [np.interp(display[..., c] * 255.0, values, self.exposure[:, c]) for c in range(3)]
        return np.stack(planes, -1).astype(np.float32)
