"""An OpenCL device: chosen by platform name and version, with kernels built once and cached.

device = open_device()                    # or open_device("PoCL"), or LUX_OPENCL_PLATFORM=PoCL
print(device.description)
x = device.array(np.zeros((4, 3), np.float32))      # pyopencl.array.Array
program = device.program("projection", {"CHANNELS": 3})   # kernels/projection.cl
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyopencl as cl
import pyopencl.array as cla
from pyopencl.tools import ImmediateAllocator, MemoryPool

from luxcore.errors import DeviceError

KERNEL_FOLDER = Path(__file__).parents[2] / "kernels"
DEFAULT_GROUP = 64
PLATFORM_VARIABLE = "LUX_OPENCL_PLATFORM"

PixelMapping = Literal["block", "pixel"]
Defines = Mapping[str, int | float | str]


class Kernels:
    """The kernels of one built program as attributes; each is retrieved once and then reused."""

    def __init__(self, program: cl.Program) -> None:
        self._program = program

    def __getattr__(self, name: str) -> cl.Kernel:
        kernel = cl.Kernel(self._program, name)
        setattr(self, name, kernel)
        return kernel


@dataclass(frozen=True, eq=False)
class Device:
    """One OpenCL context and in-order queue.

    `mapping` says how pixels meet work-items: "block" (one work-item per tile, `float16` blocks)
    for CPUs, "pixel" (one work-item per pixel, local memory) for GPUs.
    """

    context: cl.Context
    queue: cl.CommandQueue
    mapping: PixelMapping
    pool: MemoryPool
    """Freed arrays are kept and handed out again: fresh pages cost more than the kernels."""
    _programs: dict[tuple[Any, ...], Kernels] = field(default_factory=dict, repr=False)

    @property
    def description(self) -> str:
        """One line: platform, its version, device."""
        device = self.queue.device
        platform = device.platform
        return f"{platform.name} ({platform.version.strip()}) on {device.name.strip()}"

    def array(self, values: np.ndarray) -> cla.Array:
        """A copy of `values` on the device, C order, dtype kept."""
        return cla.to_device(self.queue, np.ascontiguousarray(values), allocator=self._allocate)

    def zeros(self, shape: tuple[int, ...], dtype: Any = np.float32) -> cla.Array:
        """An array of zeros on the device."""
        return cla.zeros(self.queue, shape, dtype, allocator=self._allocate)

    def empty(self, shape: tuple[int, ...], dtype: Any = np.float32) -> cla.Array:
        """An array on the device whose contents are undefined."""
        return cla.empty(self.queue, shape, dtype, allocator=self._allocate)

    def _allocate(self, size: int) -> Any:
        try:
            return self.pool(size)
        except cl.Error as error:
            raise DeviceError(
                f"{self.description} cannot hold an array of {size / 1e9:.2f} GB ({error}); "
                f"ask for fewer pixels or Gaussians."
            ) from error

    def program(self, name: str, defines: Defines | None = None) -> Kernels:
        """The kernels of `kernels/<name>.cl` with each define passed as -D; built once per set.

        Raises DeviceError naming the file when the kernel does not build.
        """
        options = tuple(sorted((k, define_text(v)) for k, v in (defines or {}).items()))
        key = (name, options)
        if key not in self._programs:
            self._programs[key] = self._build(name, options)
        return self._programs[key]

    def launch(
        self,
        kernel: cl.Kernel,
        work_items: int | tuple[int, ...],
        *arguments: Any,
        group: int | None = None,
    ) -> None:
        """Enqueues `kernel` over `work_items`; nothing happens for zero of them.

        With `group`, work-groups have that size along the first axis and the number of work-items
        is rounded up to a multiple of it: the kernel must return for the ones beyond its count.
        Without it, whole groups of 64 run first and the rest in groups of one (so the kernel must
        not ask for its global size); along several axes,
        groups of the largest power of two up to 64 that divides the first. Never the driver's
        choice: PoCL compiles a kernel again for every size of work-group it meets.
        An int becomes int32, a float becomes float32, None and an empty array a null pointer.
        """
        items = (work_items,) if isinstance(work_items, int) else work_items
        if not all(items):
            return
        values = [_argument(a) for a in arguments]
        ones = tuple(1 for _ in items[1:])
        if group is None and not ones:
            whole = items[0] // DEFAULT_GROUP * DEFAULT_GROUP
            if whole:
                kernel(self.queue, (whole,), (DEFAULT_GROUP,), *values)
            if items[0] > whole:
                rest = (items[0] - whole,)
                kernel(self.queue, rest, (1,), *values, global_offset=(whole,))
            return
        size = group or math.gcd(items[0], DEFAULT_GROUP)
        rounded = (-(-items[0] // size) * size, *items[1:])
        kernel(self.queue, rounded, (size, *ones), *values)

    def _build(self, name: str, options: tuple[tuple[str, str], ...]) -> Kernels:
        path = KERNEL_FOLDER / f"{name}.cl"
        flags = ["-cl-std=CL1.2", f"-I {KERNEL_FOLDER}", *(f"-D {k}={v}" for k, v in options)]
        try:
            return Kernels(cl.Program(self.context, path.read_text()).build(options=flags))
        except (OSError, cl.Error) as error:
            raise DeviceError(f"kernel {path.name} does not build: {error}.") from error


def _argument(value: Any) -> Any:
    if isinstance(value, cla.Array):
        return value.data if value.size else None
    if isinstance(value, int):
        return np.int32(value)
    return np.float32(value) if isinstance(value, float) else value


def define_text(value: int | float | str) -> str:
    """The OpenCL C spelling of a constant: floats in fp32 with all digits."""
    if isinstance(value, bool | int | np.integer):
        return str(int(value))
    if isinstance(value, float | np.floating):
        return f"{float(np.float32(value))!r}f"
    return value


def open_device(platform: str | None = None, mapping: PixelMapping | None = None) -> Device:
    """The device whose platform name and version contain `platform` (any case).

    Without an argument, the environment variable LUX_OPENCL_PLATFORM; without that, the first GPU,
    else the first device. `mapping` overrides the one that suits the device, for tests.

    Raises DeviceError when there is no OpenCL platform or none that matches.
    """
    wanted = platform if platform is not None else os.environ.get(PLATFORM_VARIABLE, "")
    return _open(wanted, mapping)


@lru_cache(maxsize=8)
def _open(wanted: str, mapping: PixelMapping | None) -> Device:
    device = _choose(wanted)
    context = cl.Context([device])
    is_gpu = bool(device.type & cl.device_type.GPU)
    queue = cl.CommandQueue(context)
    pool = MemoryPool(ImmediateAllocator(queue))
    return Device(context, queue, mapping or ("pixel" if is_gpu else "block"), pool)


def _choose(wanted: str) -> cl.Device:
    try:
        platforms = cl.get_platforms()
    except cl.Error as error:
        raise DeviceError(f"no OpenCL platform was found ({error}); install PoCL.") from error
    if not platforms:
        raise DeviceError("no OpenCL platform was found; install PoCL (pocl-opencl-icd).")
    names = [f"{p.name} {p.version.strip()}" for p in platforms]
    chosen = [p for p, n in zip(platforms, names, strict=True) if wanted.lower() in n.lower()]
    devices = [d for p in chosen for d in p.get_devices()]
    if not devices:
        raise DeviceError(f"no OpenCL device on a platform named {wanted!r}; found {names}.")
    return next((d for d in devices if d.type & cl.device_type.GPU), devices[0])
