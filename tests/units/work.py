"""Units for the tests: importable by worker processes."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import numpy as np

from luxcore.errors import LuxError


def draw(out_dir: Path, seed: int) -> None:
    """A unit whose bytes depend on its seed alone."""
    numbers = np.random.Generator(np.random.PCG64(seed)).random(64)
    (out_dir / "numbers.bin").write_bytes(numbers.tobytes())


def draw_unless_poisoned(out_dir: Path, seed: int) -> None:
    """Seed 3 is a scene that always fails."""
    if seed == 3:
        raise LuxError("the lamp has no bulb.")
    draw(out_dir, seed)


def sleep(out_dir: Path, seconds: float) -> None:
    (out_dir / "started").write_text("yes")
    time.sleep(seconds)


def eat_memory(out_dir: Path, megabytes: int) -> None:
    (out_dir / "eaten").write_text(str(len(bytearray(megabytes << 20))))


def die(out_dir: Path) -> None:
    """What the kernel's out-of-memory killer does."""
    os.kill(os.getpid(), signal.SIGKILL)


def draw_slowly(out_dir: Path, seed: int, log: str) -> None:
    """Leaves a line for every unit that was really computed."""
    time.sleep(0.05)
    with open(log, "a", encoding="utf-8") as stream:
        stream.write(f"{seed}\n")
    draw(out_dir, seed)


def draw_and_tell(out_dir: Path, seed: int) -> dict[str, float]:
    """Says what it cost, as a render does."""
    draw(out_dir, seed)
    return {"build": 0.25, "render": float(seed)}
