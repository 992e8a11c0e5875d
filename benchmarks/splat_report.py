"""All rows of `python -m benchmarks.splats`, its table and its summary line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks.opensplat import opensplat_row
from benchmarks.splat_relight import relight_row
from benchmarks.splat_rows import (
    LAMPS,
    digest,
    frozen_row,
    kernel_rows,
    memory_row,
    million_row,
    pass_row,
    torch_row,
)
from benchmarks.splat_scenes import captured_view, random_view
from luxcore.splats.device import Device

PUBLISHED = {
    "machine": "2 Zen 5 cores",
    "OpenSplat CPU mode, published comparison": {"forward": 559.0, "backward": 436.0},
    "trial OpenCL, blending kernels alone": {"forward": 26.5, "backward": 37.5},
}
"""CPU milliseconds at 100,000 Gaussians, 512x512, 3 channels, measured by others elsewhere."""


def run_all(device: Device, quick: bool, opensplat: Path | None = None) -> dict[str, Any]:
    """Every row of the report. `opensplat` is a checkout of it, to be measured in the same run."""
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
        "opensplat": [opensplat_row(device, s, opensplat) for s in scenes] if opensplat else [],
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
    for row in report["opensplat"]:
        name = f"OpenSplat CPU mode, {row['scene']}"
        print(
            f"{name:42s} {row['forward_cpu_ms']:10.0f} {row['backward_cpu_ms']:10.0f}   "
            f"{row['forward_ratio']:.1f} and {row['backward_ratio']:.1f} times the engine's, in "
            f"turn; images differ by {row['mean_difference']:.0e}"
        )
    for name, figures in report["published"].items():
        if name != "machine":
            label = f"{name} [{report['published']['machine']}]"
            print(f"{label}: {figures['forward']:.1f} {figures['backward']:.1f}")
    print_blending(report["blending"])
    for curve, rows in report["curves"].items():
        cells = [
            f"{r[curve]:g}: {r['forward_cpu_ms']:.1f}/{r['backward_cpu_ms']:.1f}" for r in rows
        ]
        print(f"{curve:10s}", "  ".join(cells))
    for name in ("frozen_8_lamps", "relight_8_lamps", "memory", "million_1080p"):
        print(f"{name}:", {k: round(v, 2) for k, v in (report[name] or {}).items()})
    print("digest:", report["digest"])
    print(summary(report))


def print_blending(blending: dict[str, Any]) -> None:
    """The kernels alone and the machine's limit."""
    print("kernels:", {k: round(v, 1) for k, v in blending["kernels_cpu_ms"].items()})
    print(
        f"machine: {blending['machine_gflop_per_cpu_s']:.0f} GFLOP and "
        f"{blending['machine_gb_per_cpu_s']:.0f} GB per CPU-second; blending reaches "
        f"{blending['forward_fraction_of_limit']:.0%} / "
        f"{blending['backward_fraction_of_limit']:.0%} of the arithmetic"
    )


def summary(report: dict[str, Any]) -> str:
    """One line: the ratios that were asked for."""
    row = report["engine"][1]
    forward, backward = lamp_ratio(report)
    frozen = report["frozen_8_lamps"]
    torch_rows = {r["scene"]: r for r in report["torch"]}
    beside = torch_rows.get(row["scene"], report["torch"][0])
    own = next(r for r in report["engine"] if r["scene"] == beside["scene"])
    return (
        f"summary: 100,000 Gaussians {row['forward_cpu_ms']:.1f} / {row['backward_cpu_ms']:.1f} "
        f"CPU-ms; {opensplat_ratio(report)}; torch over this "
        f"{beside['forward_cpu_ms'] / own['forward_cpu_ms']:.0f}x / "
        f"{beside['backward_cpu_ms'] / own['backward_cpu_ms']:.0f}x; "
        f"8 lamps {forward:.2f}x / {backward:.2f}x of one, with baked weights "
        f"{frozen['forward_ratio']:.2f}x / {frozen['backward_ratio']:.2f}x"
    )


def opensplat_ratio(report: dict[str, Any]) -> str:
    """OpenSplat over the engine at 100,000 Gaussians: of this run where it was measured."""
    row = report["engine"][1]
    for peer in report["opensplat"]:
        if peer["scene"] == row["scene"]:
            ratios = f"{peer['forward_ratio']:.1f}x / {peer['backward_ratio']:.1f}x"
            return f"OpenSplat in this run over this {ratios}"
    published = PUBLISHED["OpenSplat CPU mode, published comparison"]
    assert isinstance(published, dict)
    ratios = [published[n] / row[f"{n}_cpu_ms"] for n in ("forward", "backward")]
    return f"published OpenSplat (other machine) over this {ratios[0]:.1f}x / {ratios[1]:.1f}x"
