"""Pictures a command writes: linear light as EXR, what a display shows as PNG."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from luxcore.errors import InputError

if TYPE_CHECKING:
    import numpy as np

_SUFFIXES = (".png", ".exr")


def check_out(path: Path) -> None:
    """Refuse a name that says neither PNG nor EXR, before any work is done."""
    if path.suffix.lower() not in _SUFFIXES:
        raise InputError(f"{path} must end in {' or '.join(_SUFFIXES)}.")


def write_image(path: Path, linear: np.ndarray | None, display: np.ndarray) -> None:
    """PNG of `display`; EXR (float32) of `linear`, or of `display` where there is no linear."""
    from luxcore.files.exr import write_exr
    from luxcore.files.photos import write_png

    if path.suffix.lower() == ".png":
        write_png(path, display)
    else:
        write_exr(path, {"image": display if linear is None else linear}, half=False)
