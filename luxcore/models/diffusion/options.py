"""Settings from files and from a backend's options: one sentence for each mistake."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from luxcore.errors import InputError
from luxcore.files.digests import value_digest
from luxcore.settings.base import Settings
from luxcore.settings.load import read_yaml

Section = TypeVar("Section", bound=Settings)

WITHOUT_EFFECT: Any = {
    "loop": {"workers", "checkpoint_every", "keep_checkpoints", "validate_every", "log_every"},
    "data": {"root"},
    "model": {"base"},
}
"""Settings of a training that may change between stops: they do not change what is learned."""


def read_settings(kind: type[Section], path: Path) -> Section:
    """Settings from a YAML or JSON file. Raises InputError naming the file, the key, the fact."""
    return parse_options(kind, read_yaml(path) or {}, str(path))


def parse_options(kind: type[Section], values: Any, source: str) -> Section:
    """Settings from plain values; `source` is named in errors."""
    if not isinstance(values, Mapping):
        raise InputError(f"{source} must hold settings by name, got {type(values).__name__}.")
    try:
        return kind.model_validate(dict(values))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or kind.__name__
        if first["type"] == "extra_forbidden":
            raise InputError(f"{source}: unknown key {where}.") from error
        raise InputError(f"{source}: {where}: {first['msg']}.") from error


def training_digest(settings: Settings) -> str:
    """Names what a training learns: equal for settings that lead to the same weights."""
    return value_digest(settings.model_dump(mode="json", exclude=WITHOUT_EFFECT))
