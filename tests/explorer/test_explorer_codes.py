"""Logarithmic codes: precision where the eye sees it, nothing lost at the ends."""

import io

import numpy as np
import pytest
from PIL import Image

from luxcore.explorer.codes import LOSSLESS, SLOPE, decode, encode, fit_webp, span_of


@pytest.mark.parametrize("peak", [4e-3, 1.0, 60.0, 5e4])
def test_codes_keep_radiance_to_half_a_step(peak: float) -> None:
    values = np.geomspace(1e-6, peak, 3000).reshape(-1, 1, 1) * np.ones((1, 1, 3))
    span = span_of(values)
    back = decode(encode(values, span), span)
    step = 2.0 ** (span / 255 / 2) - 1.0
    # d/dcode of (2^(code·span) − 1)/SLOPE is proportional to value + 1/SLOPE.
    assert (np.abs(back - values) <= 1.001 * step * (values + 1 / SLOPE)).all()
    assert back.max() == pytest.approx(peak, rel=1e-5)


def test_black_and_negative_light_is_black() -> None:
    layer = np.full((2, 2, 3), -0.5, np.float32)
    span = span_of(layer)
    assert span > 0
    assert (decode(encode(layer, span), span) == 0).all()


def test_quality_falls_until_the_budget_holds() -> None:
    noise = np.random.Generator(np.random.PCG64(1)).integers(0, 256, (64, 64, 3)).astype(np.uint8)
    _, (exact,), best = fit_webp(noise, [noise], 1_000_000)
    assert best == LOSSLESS
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(exact))), noise)
    shown, files, quality = fit_webp(noise, [noise], len(exact) // 2)
    assert quality < best
    assert len(shown) + len(files[0]) <= len(exact) // 2
