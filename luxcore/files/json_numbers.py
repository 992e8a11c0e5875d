"""Values out of JSON, which may hold NaN, Infinity, 1e999 or a word where another thing is due."""

from __future__ import annotations

import json
import math
from typing import Any

LARGEST = 1e12
"""What is larger is no measure of a room; products of such numbers must fit float32."""


def parse_json(text: str) -> Any:
    """What `text` says; NaN and infinities, which JSON does not have, are null: not known.

    Raises ValueError or RecursionError for text that is no JSON.
    """
    return json.loads(text, parse_constant=lambda _: None, parse_float=_known)


def finite(value: Any, name: str) -> float:
    """`value` as a float. Raises ValueError naming `name` unless it is finite and below 1e12."""
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not abs(number) < LARGEST:
        raise ValueError(f"{name} is {_quoted(value)}, no usable number")
    return number


def positive(value: Any, name: str) -> float:
    """The same above zero."""
    number = finite(value, name)
    if number <= 0:
        raise ValueError(f"{name} is {number:g}, it must be above 0")
    return number


def whole(value: Any, name: str) -> int:
    """A whole number, 0 or more."""
    number = finite(value, name)
    if number < 0 or number != int(number):
        raise ValueError(f"{name} is {_quoted(value)}, no whole number from 0 on")
    return int(number)


def flag(value: Any, name: str) -> bool:
    """true or false; "no" is neither."""
    if not isinstance(value, bool):
        raise ValueError(f"{name} is {_quoted(value)}, neither true nor false")
    return value


def three(values: Any, name: str) -> tuple[float, float, float]:
    """Three finite numbers, such as a place or a colour."""
    if not isinstance(values, list | tuple) or len(values) != 3:
        raise ValueError(f"{name} is {_quoted(values)}, not three numbers")
    x, y, z = (finite(value, name) for value in values)
    return x, y, z


def _known(text: str) -> float | None:
    number = float(text)
    return number if math.isfinite(number) else None


def _quoted(value: Any) -> str:
    return f"{json.dumps(value, default=repr):.40}"
