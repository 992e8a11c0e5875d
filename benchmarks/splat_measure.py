"""Timing of the rasterizer in process CPU time and wall time, and what the machine could do."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from benchmarks.splat_scenes import BenchmarkScene
from luxcore.splats.baked import bake
from luxcore.splats.device import Device
from luxcore.splats.rasterizer import RasterConfig, Rasterizer

FORWARD_FLOP = 35
"""Floating-point operations of one contribution before features: offsets 2, exponent 8, 2^p 15,
ceiling and cut-off 3, transmittance and weight 5, alpha 2. Each feature adds 2."""
BACKWARD_FLOP = 62
"""The same 35, h 9 with its division, six moments 18. Each feature adds 4."""


@dataclass(frozen=True)
class Timing:
    """Milliseconds of one call: medians, and the least CPU time seen."""

    cpu_ms: float
    wall_ms: float
    cpu_min_ms: float


def measure(call: Callable[[], object], repeats: int = 9, warm_up: int = 2) -> Timing:
    """Process CPU time counts all threads; wall time suffers from whoever shares the machine."""
    for _ in range(warm_up):
        call()
    cpu, wall = [], []
    for _ in range(repeats):
        start = time.process_time(), time.perf_counter()
        call()
        cpu.append(1e3 * (time.process_time() - start[0]))
        wall.append(1e3 * (time.perf_counter() - start[1]))
    return Timing(float(np.median(cpu)), float(np.median(wall)), min(cpu))


def interleaved(calls: Mapping[str, Callable[[], object]], repeats: int = 11) -> dict[str, float]:
    """Median CPU milliseconds of each call, all called in turn, so that ratios share the noise."""
    spent: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(repeats + 2):
        for name, call in calls.items():
            start = time.process_time()
            call()
            spent[name].append(1e3 * (time.process_time() - start))
    return {name: float(np.median(values[2:])) for name, values in spent.items()}


class TimedDevice(Device):
    """A device that waits for every kernel and notes its CPU milliseconds."""

    def launch(self, kernel: Any, work_items: Any, *arguments: Any, **keywords: Any) -> None:
        start = time.process_time()
        super().launch(kernel, work_items, *arguments, **keywords)
        self.queue.finish()
        self.__dict__.setdefault("spent", defaultdict(float))[kernel.function_name] += 1e3 * (
            time.process_time() - start
        )

    def take_times(self) -> dict[str, float]:
        """Milliseconds by kernel since the last call."""
        return dict(self.__dict__.pop("spent", {}))


def timed(device: Device) -> TimedDevice:
    """The same context, queue and programs."""
    return TimedDevice(**{f.name: getattr(device, f.name) for f in fields(device)})


@dataclass(frozen=True)
class Pass:
    """One configuration on one scene, ready to run."""

    device: Device
    rasterizer: Rasterizer
    scene: BenchmarkScene
    arrays: list[Any]
    out: Any
    d_image: Any

    @classmethod
    def prepare(cls, device: Device, scene: BenchmarkScene, channels: int = 3) -> Pass:
        """Uploads the scene and runs it once."""
        rasterizer = Rasterizer(device, RasterConfig(channels))
        arrays = scene.on_device(device, channels)
        out = rasterizer.forward(scene.camera, *arrays)
        noise = np.random.default_rng(0).normal(size=out.image.shape).astype(np.float32)
        return cls(device, rasterizer, scene, arrays, out, device.array(noise))

    def forward(self) -> Any:
        """One forward pass, waited for."""
        out = self.rasterizer.forward(self.scene.camera, *self.arrays)
        self.device.queue.finish()
        return out

    def backward(self) -> Any:
        """One backward pass, waited for."""
        gradients = self.rasterizer.backward(self.out, self.d_image)
        self.device.queue.finish()
        return gradients

    def kernel_times(self, repeats: int = 7) -> dict[str, float]:
        """Median CPU milliseconds of each kernel over one forward and one backward pass."""
        device = timed(self.device)
        rasterizer = Rasterizer(device, self.rasterizer.config)
        rounds = []
        for _ in range(repeats + 1):
            out = rasterizer.forward(self.scene.camera, *self.arrays)
            rasterizer.backward(out, self.d_image)
            rounds.append(device.take_times())
        names = rounds[-1]
        return {n: float(np.median([r[n] for r in rounds[1:]])) for n in names}

    def contributions(self) -> int:
        """(Gaussian, pixel) pairs that were blended."""
        return bake(self.device, self.out).nonzeros


def machine_limits(device: Device) -> tuple[float, float]:
    """(GFLOP, GB read) per CPU-second, the best of several tries."""
    kernels, parts, turns = device.program("limits"), 16, 1 << 15
    out, memory = device.zeros((parts * 16,)), device.zeros((1 << 26,))
    vectors = (1 << 26) // 16 // parts

    def chains() -> None:
        device.launch(kernels.fma_chains, parts, turns, out, group=1)
        device.queue.finish()

    def read() -> None:
        device.launch(kernels.read_memory, parts, vectors, memory, out, group=1)
        device.queue.finish()

    flop = measure(chains).cpu_min_ms
    return parts * turns * 512 / flop / 1e6, (1 << 28) / measure(read).cpu_min_ms / 1e6
