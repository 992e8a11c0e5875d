"""Intel Open Image Denoise through ctypes, from the library inside the bpy package.

One light at a time, with albedo and normal; the energy of the noisy image is kept.
"""

from __future__ import annotations

import ctypes
import importlib.util
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from luxcore.errors import LuxError

_CPU_DEVICE, _FLOAT3 = 1, 3
_QUALITY = {"fast": 4, "balanced": 5, "high": 6}

Image = Float[np.ndarray, "h w 3"]


class Denoiser:
    """A filter for images of one size that share albedo and normal. Bits do not depend on threads.

    `albedo` is clipped to 0..1 (Cycles adds emission to it, up to 187); `normal` is in [-1, 1].
    """

    def __init__(self, albedo: Image, normal: Image, *, quality: str, threads: int) -> None:
        self._library = _load()
        self._albedo = np.ascontiguousarray(np.clip(albedo, 0, 1), np.float32)
        self._normal = np.ascontiguousarray(np.clip(normal, -1, 1), np.float32)
        self._color = np.zeros_like(self._albedo)
        self._output = np.zeros_like(self._albedo)
        self._device = _device(threads)
        self._filter = self._library.oidnNewFilter(self._device, b"RT")
        height, width, _ = self._albedo.shape
        if self._normal.shape != (height, width, 3):
            raise ValueError(f"normal must have shape {self._albedo.shape}, got {normal.shape}.")
        for name, image in (
            ("color", self._color),
            ("albedo", self._albedo),
            ("normal", self._normal),
            ("output", self._output),
        ):
            self._library.oidnSetSharedFilterImage(
                self._filter, name.encode(), image.ctypes.data, _FLOAT3, width, height, 0, 0, 0
            )
        self._library.oidnSetFilterBool(self._filter, b"hdr", True)
        self._library.oidnSetFilterInt(self._filter, b"quality", _QUALITY[quality])
        self._library.oidnCommitFilter(self._filter)
        _check(self._library, self._device)

    def __call__(self, noisy: Image) -> Image:
        """The denoised image [h, w, 3], linear radiance, not negative."""
        self._color[...] = noisy
        self._library.oidnExecuteFilter(self._filter)
        _check(self._library, self._device)
        return np.maximum(self._output, 0).copy()

    def close(self) -> None:
        """Free the filter; the images go with this object."""
        self._library.oidnReleaseFilter(self._filter)


def keep_energy(
    noisy: Image,
    denoised: Image,
    emitter: Bool[np.ndarray, "h w"],
    rim: Bool[np.ndarray, "h w"],
) -> tuple[Image, float]:
    """Scale the denoised image to the noisy mean (the filter loses 8-20 % of sparse light).

    `emitter` keeps its brightness: it is nearly free of noise. `rim`, the pixels around it, holds
    light of the emitter that the pixel filter and the denoiser spread: so bright that it would
    hide the loss, hence both stay out of the means. Returns the image and the factor (0.5..2).
    """
    rest = ~(emitter | rim)
    before = float(noisy[rest].mean()) if rest.any() else 0.0
    after = float(denoised[rest].mean()) if rest.any() else 0.0
    factor = float(np.clip(before / after, 0.5, 2.0)) if after > 0 else 1.0
    kept = np.where(emitter[..., None], denoised, denoised * np.float32(factor))
    return kept, factor


@cache
def _device(threads: int) -> int:
    library = _load()
    device = library.oidnNewDevice(_CPU_DEVICE)
    library.oidnSetDeviceInt(device, b"numThreads", threads)
    library.oidnSetDeviceBool(device, b"setAffinity", False)
    library.oidnCommitDevice(device)
    _check(library, device)
    return device


def _check(library: Any, device: int) -> None:
    message = ctypes.c_char_p()
    if library.oidnGetDeviceError(device, ctypes.byref(message)) != 0:
        raise LuxError(f"the denoiser failed: {(message.value or b'').decode()}.")


@cache
def _load() -> Any:
    spec = importlib.util.find_spec("bpy")
    if spec is None or spec.origin is None:
        raise LuxError("the denoiser is part of the package bpy, which is not installed.")
    library = ctypes.CDLL(str(Path(spec.origin).parent / "lib" / "libOpenImageDenoise.so.2"))
    pointer, text, size = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t
    signatures: dict[str, tuple[Any, list[Any]]] = {
        "oidnNewDevice": (pointer, [ctypes.c_int]),
        "oidnSetDeviceInt": (None, [pointer, text, ctypes.c_int]),
        "oidnSetDeviceBool": (None, [pointer, text, ctypes.c_bool]),
        "oidnCommitDevice": (None, [pointer]),
        "oidnGetDeviceError": (ctypes.c_int, [pointer, ctypes.POINTER(text)]),
        "oidnNewFilter": (pointer, [pointer, text]),
        "oidnSetSharedFilterImage": (
            None,
            [pointer, text, pointer, ctypes.c_int, size, size, size, size, size],
        ),
        "oidnSetFilterBool": (None, [pointer, text, ctypes.c_bool]),
        "oidnSetFilterInt": (None, [pointer, text, ctypes.c_int]),
        "oidnCommitFilter": (None, [pointer]),
        "oidnExecuteFilter": (None, [pointer]),
        "oidnReleaseFilter": (None, [pointer]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library
