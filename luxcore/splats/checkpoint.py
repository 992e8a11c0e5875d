"""Checkpoints of a fit: everything the next iteration depends on, in one file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from luxcore.files.atomic import atomic_file

_FILE = "state.safetensors"


@dataclass(frozen=True)
class CheckpointFolder:
    """Where a fit keeps its state. `key` says what is being fitted: another key is another run."""

    path: Path
    key: str

    def save(self, iteration: int, state: dict[str, np.ndarray]) -> None:
        """Replace the state by that after `iteration` iterations; whole or not at all."""
        from safetensors.numpy import save_file

        metadata = {"key": self.key, "iteration": str(iteration)}
        arrays = {name: np.ascontiguousarray(array) for name, array in state.items()}
        with atomic_file(self.path / _FILE) as temporary:
            save_file(arrays, temporary, metadata=metadata)

    def load(self) -> tuple[int, dict[str, np.ndarray]] | None:
        """(iterations done, state), or None where there is none of this run.

        A damaged file or one of another run is no state: the fit starts over.
        """
        from safetensors import SafetensorError, safe_open

        file = self.path / _FILE
        if not file.is_file():
            return None
        try:
            with safe_open(file, framework="numpy") as stream:
                metadata = stream.metadata() or {}
                if metadata.get("key") != self.key:
                    return None
                state = {name: stream.get_tensor(name) for name in stream.keys()}  # noqa: SIM118
            return int(metadata["iteration"]), state
        except (SafetensorError, OSError, KeyError, ValueError):
            return None

    def clear(self) -> None:
        """Forget the state, once the result is on disk."""
        (self.path / _FILE).unlink(missing_ok=True)


def part(state: dict[str, np.ndarray], prefix: str) -> dict[str, np.ndarray]:
    """The entries called `prefix/name`, by name."""
    start = f"{prefix}/"
    return {k.removeprefix(start): v for k, v in state.items() if k.startswith(start)}


def prefixed(prefix: str, state: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The inverse of `part`."""
    return {f"{prefix}/{name}": array for name, array in state.items()}
