"""The Blender process that reads scenes: one JSON request a line in, one JSON answer a line out.

`python -m luxcore.imports.blender.server`. Blender prints to file descriptor 1, so the answers use
a copy of it taken before Blender starts. Scripts, drivers and add-ons of a file never run.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any


def main() -> None:
    """Serve requests until the parent goes away."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    import bpy

    bpy.context.preferences.filepaths.use_scripts_auto_execute = False
    from luxcore.imports.blender.reader import read_scene

    for line in sys.stdin:
        answers.write(json.dumps(_answer(read_scene, json.loads(line))) + "\n")
        answers.flush()


def _answer(read_scene: Any, request: dict[str, Any]) -> dict[str, Any]:
    try:
        return {"ok": read_scene([Path(p) for p in request["paths"]], Path(request["out"]))}
    except Exception as error:
        return {"error": f"{type(error).__name__}: {error}"}


if __name__ == "__main__":
    main()
