"""sha256 of files, pixels and values. Pixels are hashed where file bytes carry time stamps."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np


def file_digest(path: Path) -> str:
    """sha256 of a file's bytes."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def array_digest(array: np.ndarray) -> str:
    """sha256 of dtype, shape and values, whatever the memory order."""
    digest = hashlib.sha256(f"{array.dtype.str}{array.shape}".encode())
    digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def value_digest(value: Any) -> str:
    """sha256 of a JSON value; key order does not matter."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def tree_digest(paths: Iterable[Path], root: Path) -> str:
    """sha256 over the files in `paths` (folders are walked), by name relative to `root`."""
    digest = hashlib.sha256()
    for file in sorted(_files(paths)):
        digest.update(str(file.relative_to(root)).encode() + b"\0")
        digest.update(file_digest(file).encode())
    return digest.hexdigest()


def _files(paths: Iterable[Path]) -> Iterable[Path]:
    for path in paths:
        if path.is_dir():
            yield from (f for f in path.rglob("*") if f.is_file() and "__pycache__" not in f.parts)
        else:
            yield path
