"""One row of the rasterizer's report per function: what is run, and what is counted."""

from __future__ import annotations

import hashlib
import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

from benchmarks.splat_measure import (
    BACKWARD_FLOP,
    FORWARD_FLOP,
    Pass,
    interleaved,
    machine_limits,
    measure,
)
from benchmarks.splat_scenes import BenchmarkScene, random_view
from luxcore.splats.baked import bake, padded, padded_zeros
from luxcore.splats.device import Device, open_device

LAMPS = 8


def pass_row(device: Device, scene: BenchmarkScene, channels: int = 3) -> dict[str, Any]:
    """Forward and backward of one scene."""
    run = Pass.prepare(device, scene, channels)
    forward, backward = measure(run.forward), measure(run.backward)
    return {
        "scene": scene.name,
        "gaussians": len(scene.means),
        "pixels": scene.camera.width * scene.camera.height,
        "lamps": channels / 3,
        "intersections": run.out.intersections,
        "contributions": run.contributions(),
        "forward_cpu_ms": forward.cpu_ms,
        "forward_cpu_min_ms": forward.cpu_min_ms,
        "forward_wall_ms": forward.wall_ms,
        "backward_cpu_ms": backward.cpu_ms,
        "backward_cpu_min_ms": backward.cpu_min_ms,
        "backward_wall_ms": backward.wall_ms,
    }


def torch_row(scene: BenchmarkScene) -> dict[str, Any]:
    """The project's torch reference in float32, once. At 100,000 its graph would take 12 GB."""
    import torch

    from luxcore.splats.rasterizer import RasterConfig
    from luxcore.splats.twin import rasterize

    names = ("means", "quats", "log_scales", "opacity_logits", "colors")
    leaves = [
        torch.tensor(getattr(scene, n), dtype=torch.float32, requires_grad=True) for n in names
    ]
    start = time.process_time()
    out = rasterize(scene.camera, RasterConfig(), *leaves)
    middle = time.process_time()
    torch.autograd.grad(out.image.sum(), leaves)
    end = time.process_time()
    return {
        "scene": scene.name,
        "gaussians": len(scene.means),
        "forward_cpu_ms": 1e3 * (middle - start),
        "backward_cpu_ms": 1e3 * (end - middle),
    }


def kernel_rows(device: Device, scene: BenchmarkScene) -> dict[str, Any]:
    """Each kernel alone, and the fraction of the machine's arithmetic that blending reaches."""
    run = Pass.prepare(device, scene)
    times, contributions = run.kernel_times(), run.contributions()
    gflops, gbytes = machine_limits(device)
    forward_gflop = contributions * (FORWARD_FLOP + 2 * 4) / 1e9
    backward_gflop = contributions * (BACKWARD_FLOP + 4 * 3) / 1e9
    return {
        "kernels_cpu_ms": times,
        "machine_gflop_per_cpu_s": gflops,
        "machine_gb_per_cpu_s": gbytes,
        "forward_gflop": forward_gflop,
        "backward_gflop": backward_gflop,
        "forward_fraction_of_limit": forward_gflop / gflops / times["raster_forward"] * 1e3,
        "backward_fraction_of_limit": backward_gflop / gflops / times["raster_backward"] * 1e3,
    }


def frozen_row(device: Device, scene: BenchmarkScene) -> dict[str, float]:
    """8 lamps, frozen geometry, beside one lamp's pass: the same lists, and baked weights."""
    one, run = Pass.prepare(device, scene), Pass.prepare(device, scene, 3 * LAMPS)
    height, width, channels = run.out.image.shape
    lights = padded(device, run.arrays[4].get())
    image = padded_zeros(device, height * width, (height, width, channels))
    d_image = padded_zeros(device, height * width, (height, width, channels))
    d_image.set(run.d_image.get())
    d_lights = device.empty((len(scene.means), channels))
    baked = bake(device, run.out)

    def waited(call: Callable[..., object], *arguments: Any) -> Callable[[], None]:
        def wait() -> None:
            call(*arguments)
            device.queue.finish()

        return wait

    calls = {
        "one_lamp_forward": one.forward,
        "one_lamp_backward": one.backward,
        "recolor": waited(run.rasterizer.recolor, run.out, run.arrays[4]),
        "color_gradients": waited(run.rasterizer.color_gradients, run.out, run.d_image),
        "baked_render": waited(baked.render, lights, image),
        "baked_gather": waited(baked.gather, d_image, d_lights),
        "bake": waited(bake, device, run.out),
    }
    row = interleaved(calls)
    return {f"{name}_cpu_ms": value for name, value in row.items()} | {
        "baked_mb": baked.nbytes / 1e6,
        "forward_ratio": row["baked_render"] / row["one_lamp_forward"],
        "backward_ratio": row["baked_gather"] / row["one_lamp_backward"],
    }


def memory_row(device: Device, scene: BenchmarkScene) -> dict[str, float]:
    """Bytes by what they grow with, counted from the arrays themselves."""
    one, five = (Pass.prepare(device, scene, c) for c in (3, 15))
    n, pairs = len(scene.means), one.out.intersections

    def per_gaussian(run: Pass) -> float:
        parameters = sum(a.nbytes for a in run.arrays)
        lists = run.out.saved.lists
        saved = run.out.saved.records.nbytes + lists.order.nbytes + lists.offsets.nbytes
        return (2 * parameters + saved + run.out.radii.nbytes) / n  # parameters and gradients

    sizes = [r.rasterizer.config.partial_size(False) * 4 for r in (one, five)]
    return {
        "bytes_per_gaussian": per_gaussian(one),
        "bytes_per_lamp_and_gaussian": (per_gaussian(five) - per_gaussian(one)) / 4,
        "bytes_per_intersection": 12.0 + 1 + sizes[0],
        "bytes_per_lamp_and_intersection": (sizes[1] - sizes[0]) / 4,
        "intersections_per_gaussian": pairs / n,
    }


def million_row() -> dict[str, float]:
    """`million_pass` in a process of its own, so that its peak memory is its own."""
    code = "from benchmarks.splat_rows import *; print(json.dumps(million_pass()))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    row: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return row


def million_pass() -> dict[str, float]:
    """One million Gaussians at 1920x1080, forward and backward, and the process' peak memory."""
    device = open_device()
    scene = random_view(1_000_000, 1920, 1080)
    run = Pass.prepare(device, scene)
    forward, backward = measure(run.forward, 1, 0), measure(run.backward, 1, 0)
    return {
        "intersections": run.out.intersections,
        "forward_cpu_ms": forward.cpu_ms,
        "backward_cpu_ms": backward.cpu_ms,
        "peak_gb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,
    }


def digest(device: Device, scene: BenchmarkScene) -> str:
    """sha256 of an image and all gradients, the same in two runs or an error."""
    seen = set()
    for _ in range(2):
        run = Pass.prepare(device, scene)
        gradients, sha = run.backward(), hashlib.sha256(run.out.image.get().tobytes())
        for name in ("means", "quats", "log_scales", "opacity_logits", "colors"):
            sha.update(getattr(gradients, name).get().tobytes())
        seen.add(sha.hexdigest())
    if len(seen) != 1:
        raise RuntimeError("two runs on the same inputs gave different bits")
    return seen.pop()
