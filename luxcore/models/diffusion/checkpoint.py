"""Checkpoints of a training: a folder of safetensors and one JSON file, written whole or not.

Nothing else is needed to go on as if never stopped: examples and noise follow from the seed and
their position, so no state of a random generator is kept.
"""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from torch import Tensor
from torch.optim import Optimizer

from luxcore.errors import FormatError, InputError
from luxcore.files.atomic import atomic_folder, write_json
from luxcore.models.diffusion.average import RunningAverage
from luxcore.models.diffusion.weights import assign, read_weights, write_weights


@dataclass
class TrainingState:
    """What changes while training. `scaler` is the fp16 loss scaler's state, empty otherwise."""

    parameters: Mapping[str, Tensor]
    average: RunningAverage | None
    optimizer: Optimizer
    scaler: dict[str, float]


def save_checkpoint(out: Path, step: int, state: TrainingState, digest: str, keep: int) -> Path:
    """Write `out/checkpoint/<step>` and drop all but the `keep` newest."""
    tensors, scalars = _split_optimizer(state.optimizer)
    target = out / "checkpoint" / f"{step:08d}"
    with atomic_folder(target) as folder:
        write_weights(folder / "parameters.safetensors", state.parameters)
        write_weights(folder / "optimizer.safetensors", tensors)
        if state.average is not None:
            write_weights(folder / "average.safetensors", state.average.values)
        facts = {"step": step, "digest": digest, "scaler": state.scaler, "optimizer": scalars}
        write_json(folder / "state.json", facts)
    for old in _checkpoints(out)[:-keep]:
        shutil.rmtree(old)
    return target


def newest_checkpoint(out: Path) -> Path | None:
    """The checkpoint to go on from, or None for a fresh start."""
    return next(iter(_checkpoints(out)[::-1]), None)


def load_checkpoint(folder: Path, state: TrainingState, digest: str) -> int:
    """Put a checkpoint into `state` and return its step.

    Raises InputError when it was made with other settings (`digest`), FormatError when damaged.
    """
    path = folder / "state.json"
    try:
        facts = json.loads(path.read_text(encoding="utf-8"))
        step, found, scalars = facts["step"], facts["digest"], facts["optimizer"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FormatError(f"{path} is not the state of a training: {error}.") from error
    if found != digest:
        raise InputError(
            f"{folder} was made with other settings: give a new output folder, or the old settings."
        )
    parameters = folder / "parameters.safetensors"
    assign(state.parameters, read_weights(parameters), str(parameters))
    if state.average is not None:
        average = folder / "average.safetensors"
        assign(state.average.values, read_weights(average), str(average))
    _join_optimizer(state.optimizer, read_weights(folder / "optimizer.safetensors"), scalars)
    state.scaler.update(facts["scaler"])
    return int(step)


def _checkpoints(out: Path) -> list[Path]:
    return sorted(p for p in (out / "checkpoint").glob("[0-9]*") if p.is_dir())


def _split_optimizer(optimizer: Optimizer) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Tensors named "<parameter>/<key>", and the finite numbers of parameters and groups."""
    tensors: dict[str, Tensor] = {}
    numbers: dict[str, dict[str, float]] = {}
    packed = optimizer.state_dict()
    for index, entries in packed["state"].items():
        for key, value in entries.items():
            if isinstance(value, Tensor):
                tensors[f"{index}/{key}"] = value
            else:
                numbers.setdefault(str(index), {})[key] = value
    groups = [{k: v for k, v in g.items() if _is_number(v)} for g in packed["param_groups"]]
    return tensors, {"state": numbers, "groups": groups}


def _join_optimizer(
    optimizer: Optimizer, tensors: Mapping[str, Tensor], scalars: Mapping[str, Any]
) -> None:
    packed = optimizer.state_dict()
    state: dict[int, dict[str, Any]] = {int(i): dict(v) for i, v in scalars["state"].items()}
    for name, tensor in tensors.items():
        index, key = name.split("/", 1)
        state.setdefault(int(index), {})[key] = tensor
    for group, numbers in zip(packed["param_groups"], scalars["groups"], strict=True):
        group.update(numbers)
    optimizer.load_state_dict({"state": state, "param_groups": packed["param_groups"]})


def _is_number(value: object) -> bool:
    is_plain = isinstance(value, int | float) and not isinstance(value, bool)
    return is_plain and math.isfinite(value)  # type: ignore[arg-type]
