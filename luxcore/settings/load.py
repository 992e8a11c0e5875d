"""Read `params.yaml`: one sentence for each mistake, with the nearest known name."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from luxcore.errors import InputError
from luxcore.files.input import check_input_file
from luxcore.settings.base import Settings
from luxcore.settings.project import ProjectSettings

MAX_BYTES = 1_000_000
"""A larger parameter file is refused before YAML can expand anything in it."""


class _PlainLoader(yaml.SafeLoader):
    """Safe YAML without aliases and double keys: both are mistakes, never parameters."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("aliases (*name) are not allowed")
        return super().compose_node(parent, index)

    def compose_mapping_node(self, anchor: Any) -> Any:
        node = super().compose_mapping_node(anchor)
        seen: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode) and key.value in seen:
                # PyYAML would take the last of them, DVC refuses the file.
                problem = f"the key {key.value} is given twice"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key.start_mark)
            seen.add(str(key.value))
        return node


def load_settings(path: Path) -> ProjectSettings:
    """The whole of `params.yaml`. Raises InputError naming the file, the key and the fact."""
    return parse_settings(read_yaml(path), str(path))


def read_yaml(path: Path) -> Any:
    """Plain data of a small YAML file. Raises InputError."""
    path = Path(path)
    check_input_file(path)
    if path.stat().st_size > MAX_BYTES:
        raise InputError(f"{path} is larger than {MAX_BYTES} bytes, too large for parameters.")
    try:
        return yaml.load(path.read_text(encoding="utf-8"), Loader=_PlainLoader)
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not text in UTF-8.") from error
    except yaml.MarkedYAMLError as error:
        line = f"line {error.problem_mark.line + 1}: " if error.problem_mark else ""
        raise InputError(f"{path} is not plain YAML: {line}{error.problem}.") from error
    # ValueError: a number of thousands of digits, a date such as 2024-99-99.
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise InputError(f"{path} is not plain YAML: {' '.join(str(error).split())}.") from error


def parse_settings(data: Any, source: str) -> ProjectSettings:
    """Validate parsed YAML; `source` is named in errors."""
    if data is None:
        raise InputError(f"{source} must hold sections, it is empty.")
    if not isinstance(data, dict):
        raise InputError(f"{source} must hold sections, got {type(data).__name__}.")
    try:
        return ProjectSettings(**data)
    except ValidationError as error:
        raise InputError(f"{source}: {_first_problem(error)}") from error
    except TypeError as error:
        raise InputError(f"{source} has a section name that is not text: {error}.") from error


def _first_problem(error: ValidationError) -> str:
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"])
    if first["type"] != "extra_forbidden":
        given = first.get("input")
        return f"{where}: {first['msg'].lower()}, got {given!r}."
    known = _known_keys(first["loc"][:-1])
    near = difflib.get_close_matches(str(first["loc"][-1]), known, n=1, cutoff=0.5)
    hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}."
    return f"unknown key {where}; {hint}"


def _known_keys(location: tuple[Any, ...]) -> list[str]:
    model: Any = ProjectSettings
    for part in location:
        field = getattr(model, "model_fields", {}).get(part)
        model = field.annotation if field else None
    is_section = isinstance(model, type) and issubclass(model, Settings)
    return sorted(model.model_fields) if is_section else []
