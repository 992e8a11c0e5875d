"""`--set "desk=0.5,#ffd0a0"`: what a person asks of a lamp on the command line."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from typing import TYPE_CHECKING

from luxcore.errors import InputError

if TYPE_CHECKING:
    from luxcore.splats.relighting import LampSetting

_HEX = re.compile(r"#([0-9a-fA-F]{2})([0-9a-fA-F]{2})([0-9a-fA-F]{2})")
MAX_INTENSITY = 1e6


def parse_lamp_settings(options: Iterable[str]) -> dict[str, LampSetting]:
    """NAME=INTENSITY, NAME=#rrggbb or NAME=INTENSITY,#rrggbb; the last one given of a lamp counts.

    The colour is sRGB as in any picker. Raises InputError quoting the option.
    """
    from luxcore.splats.relighting import LampSetting

    settings = {}
    for option in options:
        name, equals, value = option.rpartition("=")
        if not equals or not name or not value:
            raise InputError(f'--set takes NAME=INTENSITY[,#rrggbb], got "{option}".')
        parts = [part.strip() for part in value.split(",")]
        color = _color(parts.pop(), option) if "#" in parts[-1] else None
        if len(parts) > 1:
            raise InputError(f'--set takes NAME=INTENSITY[,#rrggbb], got "{option}".')
        intensity = _intensity(parts[0], option) if parts else 1.0
        settings[name.strip()] = LampSetting(intensity, color)
    return settings


def _intensity(text: str, option: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 <= value <= MAX_INTENSITY:
        raise InputError(
            f'the intensity in --set "{option}" must be a number from 0 to {MAX_INTENSITY:g}.'
        )
    return value


def _color(text: str, option: str) -> tuple[float, float, float]:
    match = _HEX.fullmatch(text)
    if match is None:
        raise InputError(f'the colour in --set "{option}" must be #rrggbb, got {text}.')
    red, green, blue = (_linear(int(pair, 16) / 255) for pair in match.groups())
    return red, green, blue


def _linear(encoded: float) -> float:
    """IEC 61966-2-1 decoding of one value."""
    return encoded / 12.92 if encoded <= 0.04045 else ((encoded + 0.055) / 1.055) ** 2.4
