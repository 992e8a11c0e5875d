"""What numpy and torch spell differently, so that one formula can serve both."""

from __future__ import annotations

from types import ModuleType
from typing import Any, TypeVar

import numpy as np
import torch

Array = TypeVar("Array", np.ndarray, torch.Tensor)


def namespace(array: Any) -> ModuleType:
    """torch for tensors, numpy for all else; both accept `axis` and `keepdims`."""
    return torch if isinstance(array, torch.Tensor) else np


def constant(like: Array, values: np.ndarray) -> Array:
    """`values` with the precision and on the device of `like`."""
    if isinstance(like, torch.Tensor):
        return torch.as_tensor(values, dtype=like.dtype, device=like.device)
    return values.astype(like.dtype)


def colour_matrix(colours: Array, matrix: np.ndarray) -> Array:
    """`matrix` [k, 3] applied to every colour of `colours` [..., 3]."""
    return colours @ constant(colours, matrix.T)


def take_along(array: Array, order: Array) -> Array:
    """`array` picked along its last axis by `order`."""
    if isinstance(array, torch.Tensor):
        return torch.gather(array, -1, order)
    return np.take_along_axis(array, order, -1)


def as_index(array: Array) -> Array:
    """Whole numbers fit for indexing."""
    return array.long() if isinstance(array, torch.Tensor) else array.astype(np.int64)
