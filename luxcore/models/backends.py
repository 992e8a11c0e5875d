"""Backends by name. A backend is a module with `open_decomposer` and/or `open_harmonizer`."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from types import ModuleType

from luxcore.errors import InputError
from luxcore.files.input import check_input_file
from luxcore.models.interface import BackendSettings, Decomposer, Harmonizer

BACKENDS = {
    "small": "luxcore.models.small.backend",
    "flux-kontext": "luxcore.models.flux_kontext.backend",
    "multiview-unet": "luxcore.models.multiview_unet.backend",
}
"""Name to module; imported only when asked for, since diffusers alone takes 8 s."""


def check_weights(name: str, weights: str | Path | None) -> None:
    """Raises InputError where weights of the small model are not there, before torch is loaded.

    Of the paper's models a name that is no path may be a hub id.
    """
    if name == "small" and weights is not None:
        check_input_file(Path(weights))


def open_decomposer(name: str, settings: BackendSettings) -> Decomposer:
    """The single-view model of backend `name`. Raises InputError when it has none."""
    module = _backend(name)
    if not hasattr(module, "open_decomposer"):
        raise InputError(f'backend "{name}" has no single-view model.')
    return module.open_decomposer(settings)


def open_harmonizer(name: str, settings: BackendSettings) -> Harmonizer:
    """The multi-view model of backend `name`. Raises InputError when it has none."""
    module = _backend(name)
    if not hasattr(module, "open_harmonizer"):
        raise InputError(f'backend "{name}" has no multi-view model.')
    return module.open_harmonizer(settings)


def _backend(name: str) -> ModuleType:
    if name not in BACKENDS:
        raise InputError(f'there is no backend "{name}"; there are {", ".join(BACKENDS)}.')
    return import_module(BACKENDS[name])
