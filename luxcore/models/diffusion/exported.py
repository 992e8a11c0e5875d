"""Trained weights on disk: a folder with `model.json` (which model, which settings) beside them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TypeVar

from torch import Tensor

from luxcore.errors import FormatError, InputError
from luxcore.files.atomic import write_json
from luxcore.models.diffusion.base import hub_folder
from luxcore.models.diffusion.options import parse_options
from luxcore.models.diffusion.weights import (
    assign,
    read_weights,
    refuse_pickled,
    write_weights,
)
from luxcore.settings.base import Settings

Section = TypeVar("Section", bound=Settings)

Files = Mapping[str, Mapping[str, Tensor]]
"""Parameters by file name and tensor name."""


def write_exported(folder: Path, model: str, settings: Settings, files: Files) -> None:
    """Write the parameters and say what they belong to."""
    for name, tensors in files.items():
        write_weights(folder / name, tensors)
    write_json(
        folder / "model.json",
        {"version": 1, "model": model, "settings": settings.model_dump(mode="json")},
    )


def exported_folder(weights: str | None, model: str) -> Path:
    """The folder, or the hub id, that a user names. Raises InputError when it cannot be had."""
    if not weights:
        raise InputError(
            f"{model} ships no weights: train it, and name the folder (or hub id) of the result."
        )
    folder = Path(weights).expanduser()
    refuse_pickled(folder)
    return folder if folder.is_dir() else hub_folder(weights, ("*.json", "*.safetensors"))


def read_card(folder: Path, model: str, kind: type[Section]) -> Section:
    """The settings that the weights in `folder` were trained with.

    Raises FormatError when `model.json` is unreadable, InputError when it names another model.
    """
    path = folder / "model.json"
    try:
        card = json.loads(path.read_text(encoding="utf-8"))
        found, settings = card["model"], card["settings"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FormatError(f"{path} does not say what its weights are: {error}.") from error
    if found != model:
        raise InputError(f"{folder} holds weights of {found}, not of {model}.")
    return parse_options(kind, settings, str(path))


def read_exported(folder: Path, files: Files) -> None:
    """Put the weights in `folder` into `files`, every tensor of both sides."""
    for name, parameters in files.items():
        assign(parameters, read_weights(folder / name), str(folder / name))
