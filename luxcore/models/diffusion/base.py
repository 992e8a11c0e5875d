"""Pretrained bases: a local folder in diffusers' layout, or a hub id that the user gives."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

import torch
from torch import nn

from luxcore.errors import FormatError, InputError
from luxcore.models.diffusion.weights import PICKLED, require_finite

Module = TypeVar("Module", bound=nn.Module)

TEXT_FILES = ("*.json", "*.txt", "*.model")
"""Configurations and vocabularies; beside them only safetensors are fetched."""


def base_folder(base: str, components: Sequence[str]) -> Path:
    """The folder that holds `components` (`vae`, `unet` …) of a base.

    A hub id is looked up in the local hub cache and fetched when it is not there; with
    HF_HUB_OFFLINE=1 nothing is fetched. Callers look here before they import diffusers, which
    takes seconds: a missing base is said at once.

    Raises InputError in one sentence when it is nowhere, or lacks a component.
    """
    if not base:
        raise InputError("this model needs a base: set base to a local folder or to a hub id.")
    folder = Path(base).expanduser()
    if not folder.is_dir():
        files = (*TEXT_FILES, "*.safetensors")
        folder = hub_folder(base, [f"{name}/{file}" for name in components for file in files])
    for name in components:
        if not (folder / name).is_dir():
            raise InputError(f"{base} has no folder {name}: it is not a base of this model.")
    return folder


def load_component(kind: type[Module], folder: Path, name: str, dtype: torch.dtype) -> Module:
    """A diffusers or transformers module from `folder/name`, frozen, in evaluation mode.

    Raises InputError for pickled weights, FormatError for damaged, partial or NaN ones.
    """
    refuse_pickled_folder(folder / name)
    loader: Any = kind
    try:
        module, report = loader.from_pretrained(
            folder / name,
            use_safetensors=True,
            local_files_only=True,
            torch_dtype=dtype,
            output_loading_info=True,
        )
    except (OSError, ValueError, RuntimeError, KeyError) as error:
        reason = " ".join(str(error).split())[:300]
        raise FormatError(f"{folder / name} does not load as {kind.__name__}: {reason}.") from error
    missing = sorted(report["missing_keys"])
    if missing:
        raise FormatError(
            f"{folder / name} lacks {len(missing)} tensors of {kind.__name__}, "
            f"the first is {missing[0]}."
        )
    require_finite(module.named_parameters(), str(folder / name))
    return module.requires_grad_(False).eval()


def refuse_pickled_folder(folder: Path) -> None:
    """Raises InputError when `folder` has weights, but only pickled ones."""
    if any(folder.glob("*.safetensors")):
        return
    for file in sorted(folder.glob("*")):
        if file.suffix.lower() in PICKLED:
            raise InputError(f"{file} is a pickled file, which may run code; give safetensors.")


def hub_folder(repository: str, patterns: Sequence[str]) -> Path:
    """The local copy of a hub repository's files of these patterns, fetched unless it is there.

    Raises InputError in one sentence when the id is none, or cannot be had.
    """
    from huggingface_hub import snapshot_download
    from huggingface_hub.errors import HfHubHTTPError, HFValidationError, LocalEntryNotFoundError

    try:
        return Path(snapshot_download(repository, allow_patterns=list(patterns)))
    except HFValidationError as error:
        raise InputError(f"{repository} is neither a folder nor a hub id.") from error
    except LocalEntryNotFoundError as error:
        raise InputError(
            f"{repository} is no local folder, is not in the hub cache, and the hub cannot be "
            "reached."
        ) from error
    except (HfHubHTTPError, OSError) as error:
        reason = " ".join(str(error).split())[:200]
        raise InputError(f"{repository} cannot be fetched from the hub: {reason}.") from error
