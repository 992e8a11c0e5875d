"""Import this before anything of Blender: `import benchmarks.blender_alone`.

Loads bpy while the process may use one CPU, as `luxcore.render.blender.server` does: Blender's idle
worker threads would otherwise spin beside the one that renders, and be counted.
"""

from __future__ import annotations

import os

_allowed = os.sched_getaffinity(0)
os.sched_setaffinity(0, {min(_allowed)})
import bpy  # noqa: E402, F401

os.sched_setaffinity(0, _allowed)
