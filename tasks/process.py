"""What keeps a stage from running twice."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from luxcore.errors import BusyError


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
