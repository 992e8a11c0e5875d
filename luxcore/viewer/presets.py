"""Lighting as a JSON file that people can read, keep and send."""

from __future__ import annotations

import json
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from luxcore.errors import InputError
from luxcore.splats.scene import Scene
from luxcore.viewer.lighting import (
    MAX_STOPS,
    Lighting,
    Row,
    Tone,
    light_names,
    original_lighting,
)

Channel = Annotated[float, Field(ge=0.0, le=1.0)]


class _Row(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)
    on: bool
    stops: float = Field(0.0, ge=-MAX_STOPS, le=MAX_STOPS)
    colour: list[Channel] | None = Field(None, min_length=3, max_length=3)


class _Preset(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)
    version: Literal[1] = 1
    exposure_ev: float = Field(0.0, ge=-MAX_STOPS, le=MAX_STOPS)
    tone: Tone = "AgX"
    lights: dict[str, _Row]


def preset_value(scene: Scene, lighting: Lighting) -> dict:
    """The preset as a JSON value: linear RGB colours, stops relative to the photos.

    A solo row is stored as what it shows: the others off.
    """
    lights = {
        name: {
            "on": lighting.lit(i),
            "stops": row.stops,
            "colour": None if row.colour is None else list(row.colour),
        }
        for i, (name, row) in enumerate(zip(light_names(scene), lighting.rows, strict=True))
    }
    tone, exposure_ev = lighting.tone, lighting.exposure_ev
    return {"version": 1, "exposure_ev": exposure_ev, "tone": tone, "lights": lights}


def load_preset(text: str, source: str, scene: Scene) -> Lighting:
    """The lighting of a preset; lamps that it does not name stay as in the photos.

    Raises InputError naming `source` and the fact, for one a lamp that is not in the scene.
    """
    try:
        preset = _Preset(**json.loads(text))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise InputError(f"{source}: {where}: {first['msg'].lower()}.") from error
    except (ValueError, TypeError, RecursionError) as error:
        raise InputError(f"{source} is not a lighting preset: {error}.") from error
    names = light_names(scene)
    for name in preset.lights:
        if name not in names:
            known = ", ".join(names)
            raise InputError(f"{source} sets {name!r}, which is not in this scene; it has {known}.")
    rows = tuple(
        _row(preset.lights[name]) if name in preset.lights else row
        for name, row in zip(names, original_lighting(scene).rows, strict=True)
    )
    return Lighting(rows, None, preset.exposure_ev, preset.tone)


def _row(stored: _Row) -> Row:
    red_green_blue = stored.colour
    if red_green_blue is None:
        return Row(stored.on, stored.stops)
    red, green, blue = red_green_blue
    return Row(stored.on, stored.stops, (red, green, blue))
