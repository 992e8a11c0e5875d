"""Merging exposure brackets of one picture to linear light (Debevec and Malik 1997).

Each bracket is a guess at the radiance; the guesses are averaged with one weight per pixel, the
smallest of its channels' hat functions, since AgX mixes channels. What the brackets cannot say is
bounded and counted instead of made up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from luxcore.errors import InputError
from luxcore.light.response import AgxResponse, Response

_HALF_STEP = 0.5 / 255.0
_FALLBACK = 1e-4
"""Weight of a pixel with one channel at its end relative to one well inside: used when no bracket
holds the pixel well, such as a saturated lamp's black channel."""
_WELL_EXPOSED = 0.05
DISAGREEMENT = 2.0
"""Factor between two well exposed brackets beyond which they contradict each other."""

Image = Float[np.ndarray, "h w 3"]


@dataclass(frozen=True)
class Merged:
    """Linear light and what was not known, as counts of pixels."""

    radiance: Image
    clipped: int
    """White in every bracket: the radiance is a lower bound."""
    black: int
    """Black in every bracket: the radiance is an upper bound."""
    gaps: int
    """White in some brackets and black in all others: the radiance is the middle of both bounds."""
    unknown: int
    """Not finite in every bracket: the radiance is 0."""
    disagreeing: int
    """Well exposed in two brackets that differ by more than a factor of 2."""


def merge_brackets(
    images: Sequence[Image],
    exposures_ev: Sequence[float],
    response: Response | None = None,
    *,
    exposure: float = 1.0,
    cap_linear: Image | None = None,
) -> Merged:
    """Radiance I for which bracket b shows response(2^ev_b · exposure · I); AgX by default.

    `images` are display values in 0..1. A pixel that is white everywhere gets the darkest bracket's
    bound, one that is black everywhere the brightest bracket's, but not more than `cap_linear` (the
    photo that the light is a part of). Where the brackets lie so far apart that a pixel is white in
    some and black in the rest, it gets the geometric mean of its two closest bounds. A bracket
    whose pixel is not finite is left out there.
    Raises InputError for no images, differing sizes or exposures that are not finite.
    """
    _check(images, exposures_ev, exposure)
    order = np.argsort(exposures_ev, kind="stable")
    stack = np.stack([images[i] for i in order])
    finite = np.isfinite(stack).all(-1)
    shown = np.clip(np.where(finite[..., None], stack, 0.0), 0.0, 1.0).astype(np.float32)
    linear = (response or AgxResponse()).linear
    times = exposure * 2.0 ** np.asarray(exposures_ev, np.float64)[order]
    guess = np.stack([linear(s) / t for s, t in zip(shown, times, strict=True)])
    weight = np.stack([_weight(s) for s in shown]) * finite
    total = weight.sum(0)
    radiance = (guess * weight[..., None]).sum(0) / np.where(total > 0, total, 1.0)[..., None]

    known = finite.any(0)
    is_white = finite & (shown.max(-1) >= 1 - _HALF_STEP)
    is_black = finite & (shown.max(-1) <= _HALF_STEP)
    white = known & (~finite | is_white).all(0)
    black = known & (~finite | is_black).all(0)
    gap = known & (total == 0) & ~white & ~black
    radiance[white] = _first(guess, finite)[white]
    shadow = _first(guess[::-1], finite[::-1])
    if cap_linear is not None:
        shadow = np.minimum(shadow, np.maximum(cap_linear, 0.0))
    radiance[black] = shadow[black]
    # What a black pixel holds at most: black itself may stand for no light at all.
    brightest_black = linear(np.full((1, 1, 3), _HALF_STEP, np.float32))[0] / times[:, None]
    radiance[gap] = _between(
        guess[:, gap], is_white[:, gap], brightest_black[:, None], is_black[:, gap]
    )
    return Merged(
        radiance.astype(np.float32),
        clipped=int(white.sum()),
        black=int(black.sum()),
        gaps=int(gap.sum()),
        unknown=int((~known).sum()),
        disagreeing=_disagreeing(guess, weight),
    )


def _weight(shown: Image) -> Float[np.ndarray, "h w"]:
    """One weight per pixel: a hat over each channel's value, the smallest counts.

    A pixel that is clipped has none at all; one with a black channel keeps a little, from its
    brightest channel.
    """
    brightest = shown.max(-1)
    hat = 2 * np.minimum(shown, 1 - shown).min(-1)
    fallback = _FALLBACK * 2 * np.minimum(brightest, 1 - brightest)
    usable = (brightest < 1 - _HALF_STEP) & (brightest > _HALF_STEP)
    return np.where(usable, hat + fallback, 0.0)


def _first(
    guess: Float[np.ndarray, "b ... 3"], where: Bool[np.ndarray, "b ..."]
) -> Float[np.ndarray, "... 3"]:
    """Each pixel's guess from the first bracket where `where` holds."""
    return np.take_along_axis(guess, where.argmax(0)[None, ..., None], 0)[0]


def _between(
    guess: Float[np.ndarray, "b p 3"],
    is_white: Bool[np.ndarray, "b p"],
    brightest_black: Float[np.ndarray, "b 1 3"],
    is_black: Bool[np.ndarray, "b p"],
) -> Float[np.ndarray, "p 3"]:
    """Middle, in stops, of the closest bounds; brackets come from the darkest to the brightest.

    The darkest bracket that is white bounds the radiance from below, the brightest that is black
    from above.
    """
    above = np.broadcast_to(brightest_black, guess.shape)
    # AgX's inverse of a saturated white may have a negative channel.
    below = np.maximum(_first(guess, is_white), 0.0)
    return np.sqrt(below * _first(above[::-1], is_black[::-1]))


def _disagreeing(guess: Float[np.ndarray, "b h w 3"], weight: Float[np.ndarray, "b h w"]) -> int:
    """Pixels that two well exposed brackets see differently by more than DISAGREEMENT."""
    level, inside = guess.max(-1), weight > _WELL_EXPOSED
    low = np.where(inside, level, np.inf).min(0)
    high = np.where(inside, level, 0.0).max(0)
    return int((high > DISAGREEMENT * low).sum())


def _check(images: Sequence[Image], exposures_ev: Sequence[float], exposure: float) -> None:
    if not images:
        raise InputError("there are no brackets to merge.")
    if len(images) != len(exposures_ev):
        raise InputError(f"{len(images)} brackets came with {len(exposures_ev)} exposures.")
    sizes = {image.shape for image in images}
    if len(sizes) != 1:
        raise InputError(f"brackets must have one size, got {sorted(sizes)}.")
    if not np.isfinite([*exposures_ev, exposure]).all() or exposure <= 0:
        raise InputError(f"exposures must be finite and positive, got {list(exposures_ev)}.")
