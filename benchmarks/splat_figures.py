"""Curves of the rasterizer's cost, drawn from the rows of `benchmarks.splats`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

Rows = list[dict[str, Any]]


def draw_curves(curves: dict[str, Rows], folder: Path) -> list[Path]:
    """One PNG per curve: CPU milliseconds forward and backward."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    folder.mkdir(parents=True, exist_ok=True)
    labels = {"gaussians": "Gaussians", "pixels": "pixels", "lamps": "lamps (3 channels each)"}
    paths = []
    for name, rows in curves.items():
        figure, axes = pyplot.subplots(figsize=(5, 3.4), constrained_layout=True)
        x = [row[name] for row in rows]
        axes.plot(x, [row["forward_cpu_ms"] for row in rows], "o-", label="forward")
        axes.plot(x, [row["backward_cpu_ms"] for row in rows], "s-", label="backward")
        if name != "lamps":
            axes.set_xscale("log")
            axes.set_yscale("log")
        else:
            axes.set_ylim(bottom=0)
        axes.set_xlabel(labels[name])
        axes.set_ylabel("CPU ms")
        axes.grid(True, which="both", alpha=0.25)
        axes.legend(frameon=False)
        path = folder / f"splat_{name}.png"
        figure.savefig(path, dpi=110)
        pyplot.close(figure)
        paths.append(path)
    return paths
