"""Weights as safetensors and nothing else: pickled, damaged and non-finite files are refused."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import Tensor, nn

from luxcore.errors import FormatError, InputError
from luxcore.files.atomic import atomic_file

PICKLED = frozenset({".bin", ".ckpt", ".pickle", ".pkl", ".pt", ".pth", ".th"})
"""Suffixes of files that run code when they are read."""


def read_weights(path: Path) -> dict[str, Tensor]:
    """Tensors by name. Raises InputError (missing, pickled) or FormatError (damaged, NaN)."""
    path = Path(path)
    refuse_pickled(path)
    if not path.is_file():
        raise InputError(f"{path} does not exist.")
    try:
        tensors = load_file(path)
    except (SafetensorError, OSError, ValueError) as error:
        raise FormatError(f"{path} is not a readable safetensors file: {error}.") from error
    require_finite(tensors.items(), str(path))
    return tensors


def write_weights(path: Path, tensors: Mapping[str, Tensor]) -> None:
    """Write atomically. Raises InputError when a value is not finite: such weights are lost."""
    require_finite(tensors.items(), str(path))
    with atomic_file(Path(path)) as temporary:
        save_file({k: v.detach().cpu().contiguous() for k, v in tensors.items()}, temporary)


def refuse_pickled(path: Path) -> None:
    """Raises InputError when the name of the file says that reading it would run code."""
    if Path(path).suffix.lower() in PICKLED:
        raise InputError(f"{path} is a pickled file, which may run code; give safetensors.")


def require_finite(tensors: Iterable[tuple[str, Tensor]], source: str) -> None:
    """Raises FormatError naming the first tensor of `source` with a NaN or an infinity."""
    for name, tensor in tensors:
        if tensor.is_floating_point() and not torch.isfinite(tensor).all():
            raise FormatError(f"{source}: tensor {name} has values that are not finite.")


def assign(targets: Mapping[str, Tensor], tensors: Mapping[str, Tensor], source: str) -> None:
    """Copy `tensors` into `targets`, name by name.

    Raises InputError when a name of either side is missing on the other, or a shape differs: a
    file that matches only in part would load silently as the untrained model.
    """
    unknown = sorted(tensors.keys() - targets.keys())
    if unknown:
        raise InputError(
            f"{source}: {len(unknown)} of {len(tensors)} tensors match no layer of the model, "
            f"the first is {unknown[0]}."
        )
    missing = sorted(targets.keys() - tensors.keys())
    if missing:
        raise InputError(f"{source} lacks {len(missing)} tensors, the first is {missing[0]}.")
    for name, target in targets.items():
        if target.shape != tensors[name].shape:
            raise InputError(
                f"{source}: {name} must have shape {tuple(target.shape)}, "
                f"got {tuple(tensors[name].shape)}."
            )
    with torch.no_grad():
        for name, target in targets.items():
            target.copy_(tensors[name])


def trainable(module: nn.Module) -> dict[str, nn.Parameter]:
    """The parameters that training changes, by name."""
    return {name: p for name, p in module.named_parameters() if p.requires_grad}
