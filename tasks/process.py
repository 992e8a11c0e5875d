"""What keeps a stage from outliving its parent or running twice."""

from __future__ import annotations

import ctypes
import fcntl
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from luxcore.errors import BusyError, LuxError

_PR_SET_PDEATHSIG = 1


def die_with_parent() -> None:
    """Ask the kernel for SIGTERM when the parent ends: a stopped `dvc repro` leaves no orphan."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM) != 0:
        raise LuxError(f"prctl failed: {os.strerror(ctypes.get_errno())}.")


@contextmanager
def stage_lock(root: Path, name: str) -> Iterator[None]:
    """Hold the stage's lock; a second writer is told who has it. Any death frees it."""
    path = root / ".lux" / "locks" / name
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "a+", encoding="utf-8") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            stream.seek(0)
            holder = stream.read().strip() or "another process"
            raise BusyError(f"stage {name} is already running in process {holder}.") from error
        stream.truncate(0)
        stream.write(str(os.getpid()))
        stream.flush()
        yield
