"""`params.yaml` with every knob at its default and its meaning as a comment.

`python -m luxcore.settings.template > params.yaml` writes the file that ships.
"""

from __future__ import annotations

import json
import textwrap

import click
from pydantic.fields import FieldInfo

from luxcore.settings.base import Settings
from luxcore.settings.project import ProjectSettings

_HEAD = "# Every parameter of a run; defaults are the embedded profile (minutes on 2 cores).\n"
_WIDTH = 98


def default_yaml() -> str:
    """The text of the shipped `params.yaml`."""
    project = ProjectSettings()
    parts = [_HEAD]
    for name, info in ProjectSettings.model_fields.items():
        value = getattr(project, name)
        if isinstance(value, Settings):
            parts.append(f"\n# {_first_line(type(value))}\n{name}:\n{_fields(value)}")
        else:
            parts.append(_entry("", name, value, info))
    return "".join(parts)


def _fields(section: Settings) -> str:
    items = type(section).model_fields.items()
    text = "".join(_entry("  ", name, getattr(section, name), info) for name, info in items)
    return text or "  {}\n"


def _entry(indent: str, name: str, value: object, info: FieldInfo) -> str:
    meaning = " ".join((info.description or "").split())
    lines = textwrap.wrap(meaning, _WIDTH - len(indent) - 2)
    comment = "".join(f"{indent}# {line}\n" for line in lines)
    return f"{comment}{indent}{name}: {_plain(value)}\n"


def _plain(value: object) -> str:
    """JSON of a scalar or a list is YAML too."""
    return json.dumps(value, default=str)


def _first_line(section: type) -> str:
    return (section.__doc__ or "").strip().splitlines()[0]


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
def main() -> None:
    """Print params.yaml with every knob at its default."""
    click.echo(default_yaml(), nl=False)


if __name__ == "__main__":
    main()
