"""Linear radiance as 8-bit logarithmic codes, so that a whole HDR layer fits in a small WebP.

value = (2^(code/255 · span) − 1) / SLOPE, span = log2(1 + SLOPE · peak) per layer. Relighting
multiplies radiance, which only shifts codes: steps that are invisible at the original lighting stay
so at any other. Dark values (below 1/SLOPE, 5 stops under middle grey) fall on a linear foot, where
AgX hides the steps.
"""

from __future__ import annotations

import io

import numpy as np
from jaxtyping import Float, UInt8

SLOPE = 256.0
QUALITIES = (97, 94, 90, 86, 80, 72, 62, 50, 35, 20)
"""WebP qualities to try, best first, until a page fits."""


def span_of(radiance: Float[np.ndarray, "h w 3"]) -> float:
    """Width of the code range in log2 units that reaches the layer's largest value."""
    return float(np.log2(1.0 + SLOPE * max(float(radiance.max()), 1.0 / SLOPE)))


def encode(radiance: Float[np.ndarray, "h w 3"], span: float) -> UInt8[np.ndarray, "h w 3"]:
    """Codes of non-negative linear radiance (negative values become 0)."""
    codes = np.log2(1.0 + SLOPE * np.clip(radiance, 0.0, None)) / span
    return np.round(np.clip(codes, 0.0, 1.0) * 255.0).astype(np.uint8)


def decode(codes: UInt8[np.ndarray, "h w 3"], span: float) -> Float[np.ndarray, "h w 3"]:
    """Linear radiance of codes: what the page's shader computes."""
    values = (np.exp2(codes.astype(np.float64) / 255.0 * span) - 1.0) / SLOPE
    return values.astype(np.float32)


def webp(pixels: UInt8[np.ndarray, "h w 3"], quality: int) -> bytes:
    """Lossy WebP: every browser with WebGL 2 decodes it, at about 1 bit a pixel."""
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "WEBP", quality=quality, method=4)
    return stream.getvalue()


def fit_webp(pictures: list[np.ndarray], budget_bytes: int) -> tuple[list[bytes], int]:
    """All pictures as WebP within `budget_bytes` together, and the quality that was needed."""
    for quality in QUALITIES:
        files = [webp(picture, quality) for picture in pictures]
        if sum(map(len, files)) <= budget_bytes:
            break
    return files, quality
