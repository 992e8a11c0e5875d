"""Where environments come from: the CC0 HDRIs inside Blender's own package, or a file by path."""

from __future__ import annotations

import importlib.util
from functools import cache
from pathlib import Path

import numpy as np

from luxcore.errors import FormatError, InputError
from luxcore.files.exr import HALF_MAX, read_exr_image
from luxcore.files.quiet import quiet
from luxcore.light.blackbody import LUMINANCE_709


@cache
def blender_hdri_folder() -> Path:
    """`datafiles/studiolights/world` of the bpy package, found without importing it."""
    spec = importlib.util.find_spec("bpy")
    root = Path(spec.origin).parent if spec is not None and spec.origin else Path("bpy")
    found = sorted(root.glob("*/datafiles/studiolights/world"))
    if not found:
        raise InputError(f"{root} holds no datafiles/studiolights/world: is bpy installed?")
    return found[-1]


def hdri_path(name: str) -> Path:
    """A file for the name of an environment: Blender's by stem ("courtyard"), else a path."""
    path = Path(name) if name.endswith((".exr", ".hdr")) else blender_hdri_folder() / f"{name}.exr"
    if not path.is_file():
        raise InputError(f"{path} does not exist: no such environment.")
    return path


@cache
def mean_luminance(path: Path) -> float:
    """The mean radiance of an equirectangular HDRI over the sphere, as luminance.

    Raises FormatError for a file that is no picture and InputError for a black one.
    """
    luminance = usable_radiance(path)[0] @ LUMINANCE_709.astype(np.float32)
    height = luminance.shape[0]
    weight = np.cos(np.pi * (0.5 - (np.arange(height) + 0.5) / height))
    mean = float((luminance.mean(axis=1) * weight).sum() / weight.sum())
    if not mean > 0:
        raise InputError(f"{path} is black: an environment must give light.")
    return mean


@cache
def usable_radiance(path: Path) -> tuple[np.ndarray, int]:
    """[h, w, 3] radiance that can be rendered with, and how many values had to be changed for it.

    In a user's file NaN and negative values become 0, infinity the largest half. Blender's own
    files are taken as they are: a few of their values are slightly below 0.
    """
    pixels = _read_hdri(path)
    if path.parent == blender_hdri_folder():
        return pixels, 0
    clean = np.maximum(np.nan_to_num(pixels, nan=0.0, posinf=HALF_MAX, neginf=0.0), 0.0)
    return clean, int(np.count_nonzero(clean != pixels))


def _read_hdri(path: Path) -> np.ndarray:
    """[h, w, 3] linear radiance of an .exr or a Radiance .hdr."""
    if path.suffix != ".hdr":
        return read_exr_image(path, finite=False)
    import cv2

    with quiet():
        pixels = cv2.imread(str(path), cv2.IMREAD_ANYDEPTH | cv2.IMREAD_COLOR)
    if pixels is None:
        raise FormatError(f"{path} is not a readable Radiance picture.")
    return pixels[..., ::-1].astype(np.float32)
