"""New light for a known room: which lamps burn, how strongly and in which colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from numpy.random import Generator

from luxcore.data.crops import LitCrop
from luxcore.light.blackbody import blackbody_rgb, jitter_hsv
from luxcore.light.exposure import BRACKETS_EV, estimate_exposure

_LAMP_KELVIN = (2200.0, 6500.0)
_POWER_SPREAD = 0.6
"""Standard deviation of the logarithm of a lamp's power factor."""
_RECOLOURED_SHARE = 0.5
_SWITCHED_SHARE = 0.25
_OWN_SPREAD = 0.2


@dataclass(frozen=True)
class Relighting:
    """Factors on the lights and on the ambient light of a photo, the same in all of its views."""

    on: Bool[np.ndarray, " m"]
    gain: Float[np.ndarray, "m 3"]
    ambient_gain: Float[np.ndarray, " 3"]

    def apply(self, crop: LitCrop) -> LitCrop:
        """The same photo under the new light; its exposure is left as it was."""
        lights = crop.lights * self.gain[:, None, None]
        return replace(crop, on=self.on, lights=lights, ambient=crop.ambient * self.ambient_gain)


def draw_relighting(rng: Generator, lamps: int) -> Relighting:
    """Random lamps on or off, powers, black-body colours with HSV jitter, daylight strength.

    This is the paper's composition I_full' = I_full + Σ c'_i · I_i (supplement, On-the-fly
    sampling) with c'_i = (on_i · gain_i − 1) · c_i, so lamps can also be dimmed and switched off.
    """
    on = rng.random(lamps) < rng.choice([0.3, 0.7, 1.0])
    power = np.exp(rng.normal(0.0, _POWER_SPREAD, (lamps, 1)))
    colours = np.ones((lamps, 3))
    for lamp in range(lamps):
        kelvin = np.exp(rng.uniform(*np.log(_LAMP_KELVIN)))
        colour = jitter_hsv(blackbody_rgb(float(kelvin)), rng)
        if rng.random() < _RECOLOURED_SHARE:
            colours[lamp] = colour
    ambient = np.exp(rng.normal(-0.3, 0.8)) * np.ones(3)
    return Relighting(on, (power * colours).astype(np.float32), ambient.astype(np.float32))


def draw_own_light(rng: Generator, on: Bool[np.ndarray, " m"]) -> Relighting:
    """The room's own lamps, as a photographer finds them: their colours, their powers nearly,
    a quarter of them switched. Such lamps differ little in colour, which makes them hard to part.
    """
    switched = rng.random(len(on)) < _SWITCHED_SHARE
    power = np.exp(rng.normal(0.0, _OWN_SPREAD, (len(on), 1))) * np.ones((1, 3))
    ambient = np.exp(rng.normal(0.0, _OWN_SPREAD)) * np.ones(3)
    return Relighting(on ^ switched, power.astype(np.float32), ambient.astype(np.float32))


def one_more_burning(on: Bool[np.ndarray, " m"], rng: Generator) -> Bool[np.ndarray, " m"]:
    """The same lamps and one of those that are off, where there is one."""
    more = on.copy()
    if not on.all():
        more[rng.choice(np.flatnonzero(~on))] = True
    return more


def exposed(
    crops: Sequence[LitCrop],
    rng: Generator,
    jitter_ev: float = 1.0,
    metered: Bool[np.ndarray, " m"] | None = None,
) -> list[LitCrop]:
    """One exposure for all views: the median of what each asks for, up to ±`jitter_ev` stops.

    `metered` are the lamps that burnt when the exposure was chosen; None: those that burn."""
    asked = crops if metered is None else [replace(crop, on=metered) for crop in crops]
    wanted = [estimate_exposure(crop.image_linear) for crop in asked]
    exposure = float(np.median(wanted) * 2.0 ** rng.uniform(-jitter_ev, jitter_ev))
    return [replace(crop, exposure=exposure) for crop in crops]


def one_light_off(crop: LitCrop, lamp: int) -> Float[np.ndarray, "h w 3"]:
    """The photo without one lamp, linear: I_full − c·OLAT (paper, supplement). Never negative."""
    factor = np.float32(crop.on[lamp])
    return np.maximum(crop.image_linear - factor * crop.lights[lamp], 0.0)


def brackets(
    light_linear: Float[np.ndarray, "h w 3"], exposure: float
) -> Float[np.ndarray, "b h w 3"]:
    """Display images AgX(2^ev · exposure · light) at EV 0, −2, −4, in 0..1."""
    from luxcore.light.agx import agx

    factors = exposure * 2.0 ** np.array(BRACKETS_EV, np.float32)
    return agx(light_linear[None] * factors[:, None, None, None].astype(np.float32))
