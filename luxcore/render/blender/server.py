"""The Blender process: one JSON request a line on stdin, one JSON answer a line on stdout.

`python -m luxcore.render.blender.server`. Blender prints to file descriptor 1, so the answers use
a copy of it taken before Blender starts. Ends when stdin closes.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


def main() -> None:
    """Serve requests until the parent goes away."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    with _one_cpu():
        import bpy

    bpy.context.preferences.filepaths.use_scripts_auto_execute = False
    from luxcore.render.blender.job import RenderJob

    job = RenderJob()
    for line in sys.stdin:
        answers.write(json.dumps(_answer(job, json.loads(line))) + "\n")
        answers.flush()


@contextmanager
def _one_cpu() -> Iterator[None]:
    """Load under an affinity of one CPU, then give all of them back.

    TBB sizes its pool by the affinity it finds when it is loaded. Left alone, its idle workers
    spin in sched_yield beside the one thread that renders, which doubles the CPU time of a room.
    """
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(allowed)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)


def _answer(job: Any, request: dict[str, Any]) -> dict[str, Any]:
    try:
        _cap_memory(request["memory_mb"])
        return {"ok": job.render(request, Path(request["out_dir"]))}
    except Exception as error:
        return {"error": f"{type(error).__name__}: {error}", "trace": traceback.format_exc()}


def _cap_memory(memory_mb: int) -> None:
    """Allocations beyond this fail, so that one room cannot take the machine down."""
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (memory_mb << 20, hard))


if __name__ == "__main__":
    main()
