"""The rasterizer's cost, beside a torch reference and published figures, in one run.

    python -m benchmarks.splats --json FILE [--quick] [--figures docs/images]

Everything is timed in process CPU milliseconds (all threads) and wall milliseconds, at 512x512 and
a fixed seed. A forward pass is projection, binning, sort and blending; a backward pass is
everything from the image's gradient to the gradients of all parameters.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.splat_figures import draw_curves
from benchmarks.splat_measure import (
    BACKWARD_FLOP,
    FORWARD_FLOP,
    Pass,
    machine_limits,
    measure,
)
from benchmarks.splat_relight import relight_row
from benchmarks.splat_scenes import BenchmarkScene, captured_view, random_view
from luxcore.files.atomic import write_json
from luxcore.splats.baked import bake, padded, padded_zeros
from luxcore.splats.device import Device, open_device

PUBLISHED = {
    "machine": "2 Zen 5 cores",
    "OpenSplat CPU mode, published comparison": {"forward": 559.0, "backward": 436.0},
    "trial OpenCL, blending kernels alone": {"forward": 26.5, "backward": 37.5},
}
"""CPU milliseconds at 100,000 Gaussians, 512x512, 3 channels, measured by others elsewhere."""
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
    """8 lamps, frozen geometry: through the same lists, and as a sparse matrix of weights."""
    run = Pass.prepare(device, scene, 3 * LAMPS)
    height, width, channels = run.out.image.shape
    baked = bake(device, run.out)
    lights = padded(device, run.arrays[4].get())
    image = padded_zeros(device, height * width, (height, width, channels))
    d_image = padded_zeros(device, height * width, (height, width, channels))
    d_image.set(run.d_image.get())
    d_lights = padded_zeros(device, len(scene.means), (len(scene.means), channels))
    calls: dict[str, Callable[[], object]] = {
        "recolor_cpu_ms": lambda: run.rasterizer.recolor(run.out, run.arrays[4]),
        "color_gradients_cpu_ms": lambda: run.rasterizer.color_gradients(run.out, run.d_image),
        "matrix_render_cpu_ms": lambda: baked.render(lights, image),
        "matrix_gather_cpu_ms": lambda: baked.gather(d_image, d_lights),
    }

    def waited(call: Callable[[], object]) -> Callable[[], None]:
        def wait() -> None:
            call()
            device.queue.finish()

        return wait

    row = {name: measure(waited(call)).cpu_ms for name, call in calls.items()}
    return row | {"matrix_mb": baked.entries * 16 / 1e6}


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
    code = (
        "import json; from benchmarks.splats import million_pass; print(json.dumps(million_pass()))"
    )
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


def run_all(device: Device, quick: bool) -> dict[str, Any]:
    """Every row of the report."""
    big = random_view(100_000)
    garden = captured_view(Path(__file__).parents[2] / "shared" / "data")
    scenes = [random_view(10_000), big, *([garden] if garden else [])]
    counts = (1_000, 10_000, 100_000) if quick else (1_000, 3_000, 10_000, 30_000, 100_000, 300_000)
    sides = (128, 512) if quick else (128, 256, 512, 1024)
    lamps = (1, LAMPS) if quick else (1, 2, 4, 8, 16)
    return {
        "device": device.description,
        "published": PUBLISHED,
        "engine": [pass_row(device, scene) for scene in scenes],
        "torch": [torch_row(scenes[0])],
        "blending": kernel_rows(device, big),
        "frozen_8_lamps": frozen_row(device, big),
        "relight_8_lamps": relight_row(device, big),
        "memory": memory_row(device, big),
        "digest": digest(device, scenes[0]),
        "curves": {
            "gaussians": [pass_row(device, random_view(n)) for n in counts],
            "pixels": [pass_row(device, random_view(100_000, side, side)) for side in sides],
            "lamps": [pass_row(device, big, 3 * m) for m in lamps],
        },
        "million_1080p": None if quick else million_row(),
    }


def lamp_ratio(report: dict[str, Any]) -> tuple[float, float]:
    """Cost of 8 lamps in one pass over one lamp, forward and backward."""
    rows = {row["lamps"]: row for row in report["curves"]["lamps"]}
    one, many = rows[1.0], rows[float(LAMPS)]
    keys = ("forward_cpu_ms", "backward_cpu_ms")
    return many[keys[0]] / one[keys[0]], many[keys[1]] / one[keys[1]]


def print_report(report: dict[str, Any]) -> None:
    """The table, then one summary line."""
    print(report["device"])
    print(f"{'':42s} {'forward':>10s} {'backward':>10s}   CPU ms (wall ms)")
    for row in report["engine"]:
        forward = f"{row['forward_cpu_ms']:.1f} ({row['forward_wall_ms']:.0f})"
        backward = f"{row['backward_cpu_ms']:.1f} ({row['backward_wall_ms']:.0f})"
        per_pixel = row["contributions"] / row["pixels"]
        print(
            f"{row['scene']:42s} {forward:>10s} {backward:>10s}   {per_pixel:.0f} blended a pixel"
        )
    for row in report["torch"]:
        name = f"torch reference, {row['scene']}"
        print(f"{name:42s} {row['forward_cpu_ms']:10.0f} {row['backward_cpu_ms']:10.0f}")
    for name, figures in report["published"].items():
        if name != "machine":
            label = f"{name} [{report['published']['machine']}]"
            print(f"{label}: {figures['forward']:.1f} {figures['backward']:.1f}")
    blending = report["blending"]
    print("kernels:", {k: round(v, 1) for k, v in blending["kernels_cpu_ms"].items()})
    print(
        f"machine: {blending['machine_gflop_per_cpu_s']:.0f} GFLOP and "
        f"{blending['machine_gb_per_cpu_s']:.0f} GB per CPU-second; blending reaches "
        f"{blending['forward_fraction_of_limit']:.0%} / "
        f"{blending['backward_fraction_of_limit']:.0%} of the arithmetic"
    )
    for curve, rows in report["curves"].items():
        cells = [
            f"{r[curve]:g}: {r['forward_cpu_ms']:.1f}/{r['backward_cpu_ms']:.1f}" for r in rows
        ]
        print(f"{curve:10s}", "  ".join(cells))
    print("frozen, 8 lamps:", {k: round(v, 1) for k, v in report["frozen_8_lamps"].items()})
    print("relight, 8 lamps:", {k: round(v, 1) for k, v in report["relight_8_lamps"].items()})
    print("memory:", {k: round(v, 1) for k, v in report["memory"].items()})
    print("1,000,000 at 1080p:", report["million_1080p"])
    print("digest:", report["digest"])
    print(summary(report))


def summary(report: dict[str, Any]) -> str:
    """One line: the ratios that were asked for."""
    row = report["engine"][1]
    opensplat = PUBLISHED["OpenSplat CPU mode, published comparison"]
    assert isinstance(opensplat, dict)
    forward, backward = lamp_ratio(report)
    torch_rows = {r["scene"]: r for r in report["torch"]}
    beside = torch_rows.get(row["scene"], report["torch"][0])
    own = next(r for r in report["engine"] if r["scene"] == beside["scene"])
    return (
        f"summary: 100,000 Gaussians {row['forward_cpu_ms']:.1f} / {row['backward_cpu_ms']:.1f} "
        "CPU-ms; published OpenSplat (other machine) over this "
        f"{opensplat['forward'] / row['forward_cpu_ms']:.1f}x / "
        f"{opensplat['backward'] / row['backward_cpu_ms']:.1f}x; torch over this "
        f"{beside['forward_cpu_ms'] / own['forward_cpu_ms']:.0f}x / "
        f"{beside['backward_cpu_ms'] / own['backward_cpu_ms']:.0f}x; "
        f"8 lamps {forward:.2f}x / {backward:.2f}x of one"
    )


def main() -> None:
    """Runs, prints, writes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the report here")
    parser.add_argument("--quick", action="store_true", help="fewer points on the curves")
    parser.add_argument("--figures", type=Path, help="draw the curves into this folder")
    options = parser.parse_args()
    np.seterr(all="raise", under="ignore")
    report = run_all(open_device(), options.quick)
    print_report(report)
    if options.json:
        write_json(options.json, report)
    if options.figures:
        draw_curves(report["curves"], options.figures)


if __name__ == "__main__":
    main()
