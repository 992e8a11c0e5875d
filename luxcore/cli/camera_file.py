"""CAMERA.json: one nerfstudio frame."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from luxcore.errors import FormatError, InputError
from luxcore.files.input import check_input_file

if TYPE_CHECKING:
    from luxcore.cameras import Camera

_MAX_BYTES = 10_000_000
_MAX_SIDE = 32_768


def read_camera(path: Path, view: int = 0) -> Camera:
    """A frame with `fl_x fl_y cx cy w h transform_matrix`; or frame `view` of a transforms.json.

    Raises InputError or FormatError naming the file and the fact.
    """
    from luxcore.cameras import camera_from_nerfstudio

    check_input_file(path)
    if path.stat().st_size > _MAX_BYTES:
        raise FormatError(f"{path} is too large for a camera.")
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path} is not readable JSON: {error}.") from error
    frame = _frame(path, value, view)
    try:
        camera = camera_from_nerfstudio(frame, value)
    except InputError as error:
        raise FormatError(f"{path}: {error}") from error
    if max(camera.width, camera.height) > _MAX_SIDE:
        raise FormatError(f"{path} asks for {camera.width}x{camera.height} pixels, too many.")
    return camera


def _frame(path: Path, value: Any, view: int) -> dict[str, Any]:
    frames = value.get("frames", [value]) if isinstance(value, dict) else None
    if not isinstance(frames, list) or not all(isinstance(frame, dict) for frame in frames):
        raise FormatError(f"{path} must hold one nerfstudio frame.")
    if not 0 <= view < len(frames):
        raise InputError(f"{path} has views 0 to {len(frames) - 1}, asked for {view}.")
    return frames[view]
