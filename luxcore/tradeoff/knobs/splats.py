"""Knobs of both splat stages and of the rasterizer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from luxcore.capture import Capture, load_capture
from luxcore.settings.relight import RelightSettings
from luxcore.settings.splat import SplatSettings
from luxcore.splats.device import open_device
from luxcore.splats.harmonics import sh_forward
from luxcore.splats.model import DeviceGaussians
from luxcore.splats.ply import read_ply
from luxcore.splats.rasterizer import RasterConfig, Rasterizer
from luxcore.splats.stage1 import fit_geometry
from luxcore.splats.stage2 import fit_lights
from luxcore.tradeoff.knob import Bench, Choice, Knob, Work, around, stopwatch

MAX_SIDE = 160
"""Photos are shrunk to this: many short runs say more than one long one."""
SHORT = 300
"""Iterations of the runs whose subject is not iterations."""


@dataclass(frozen=True)
class _Fit:
    capture: Capture
    settings: SplatSettings
    scratch: Path


def _prepare_fit(**changes: Any) -> Callable[[Bench], _Fit]:
    def prepare(bench: Bench) -> _Fit:
        update = {"max_side": MAX_SIDE, "curve_every": 100_000, **changes}
        settings = bench.params.splat.model_copy(update=update)
        return _Fit(load_capture(bench.input("capture")), settings, bench.scratch)

    return prepare


def _fit(prepared: _Fit, choice: Choice, repeat: int) -> Work:
    settings = prepared.settings.model_copy(update=choice.section("splat"))
    with stopwatch() as watch:
        result = fit_geometry(
            prepared.capture,
            prepared.scratch / "splat",
            settings,
            seed=repeat,
            quiet=True,
            log=_mute,
        )
    return watch.work(_rmse(result.metrics.get("psnr_heldout", result.metrics["psnr_training"])))


def _mute(line: str) -> None:
    """Progress is the sweep's to tell."""


def _rmse(psnr_db: float) -> float:
    """Root mean square error of display values in 0..1."""
    return float(10.0 ** (-psnr_db / 20.0))


ERROR = "RMS error of held-out views, display 0..1"

ITERATIONS = Knob(
    name="iterations of stage 1",
    work="geometry fitted",
    choices=tuple(
        Choice(str(n), {"splat.iterations": n})
        for n in around(SplatSettings().iterations, 0.125, 0.25, 0.5, 1, 2)
    ),
    error=ERROR,
    why="Held-out error falls slowly after the default, while time goes on growing in proportion.",
    prepare=_prepare_fit(),
    run=_fit,
)

GAUSSIANS = Knob(
    name="number of Gaussians",
    work="geometry fitted",
    choices=tuple(
        Choice(f"{n:,}", {"splat.max_gaussians": n})
        for n in around(SplatSettings().max_gaussians, 1 / 16, 0.125, 0.25, 0.5, 1)
    ),
    error=ERROR,
    why="Error still falls at the default, which is where a small capture takes about a minute; "
    "raise it where there is time.",
    prepare=_prepare_fit(iterations=SHORT),
    run=_fit,
)

HARMONICS = Knob(
    name="spherical harmonics",
    work="geometry fitted",
    choices=(
        Choice("degree 0", {"splat.sh_degree": 0}),
        Choice("degree 1", {"splat.sh_degree": 1}),
        Choice("degree 3", {"splat.sh_degree": 3}),
        Choice("ask the residuals", {"splat.sh_degree": None}),
    ),
    error=ERROR,
    why="View dependence is bought only where the residuals of the photos say that it earns it.",
    prepare=_prepare_fit(iterations=SHORT),
    run=_fit,
)


@dataclass(frozen=True)
class _CutOff(RasterConfig):
    """The rasterizer, compiled with another smallest contribution."""

    alpha_min: float = 1.0 / 255.0

    def defines(self) -> dict[str, int | float | str]:
        smallest = {"ALPHA_MIN": self.alpha_min, "LOG2_ALPHA_MIN": float(np.log2(self.alpha_min))}
        return {**super().defines(), **smallest}


@dataclass(frozen=True)
class _Drawn:
    render: Callable[[float], np.ndarray]
    truth: np.ndarray


RENDERS = 20
"""Pictures of one timing: one alone takes milliseconds."""


def _prepare_cut_off(bench: Bench) -> _Drawn:
    capture = load_capture(bench.input("capture"))
    device, camera = open_device(), capture.frames[0].camera
    gaussians = read_ply(bench.input("splat") / "splats.ply")
    model = DeviceGaussians.upload(device, gaussians)
    colours = sh_forward(device, model.means, model.sh, camera.centre, gaussians.sh_degree)

    def render(alpha_min: float) -> np.ndarray:
        config = _CutOff(3, gaussians.antialiased, alpha_min=alpha_min)
        rasterizer = Rasterizer(device, config)
        for _ in range(RENDERS):
            image = rasterizer.forward(camera, *model.geometry, colours).image.get()
        return image

    return _Drawn(render, render(1e-5))


def _run_cut_off(prepared: _Drawn, choice: Choice, repeat: int) -> Work:
    smallest = 1.0 / float(choice.label.split("/")[1])
    prepared.render(smallest)
    with stopwatch() as watch:
        image = prepared.render(smallest)
    return watch.work(float(np.sqrt(np.mean((image - prepared.truth) ** 2))))


CUT_OFF = Knob(
    name="alpha cut-off",
    work="a picture drawn",
    choices=tuple(Choice(f"1/{n}", {}) for n in (4096, 1024, 255, 64, 16)),
    error="RMS error of the picture, display 0..1",
    why="A contribution below one 8-bit step cannot be seen; a higher cut-off draws edges.",
    prepare=_prepare_cut_off,
    run=_run_cut_off,
    fixed_default="1/255",
)


@dataclass(frozen=True)
class _Lights:
    capture: Capture
    folders: tuple[Path, Path, Path]
    settings: RelightSettings
    scratch: Path


def _prepare_lights(**changes: Any) -> Callable[[Bench], _Lights]:
    def prepare(bench: Bench) -> _Lights:
        update = {"max_side": MAX_SIDE, "curve_every": 100_000, **changes}
        settings = bench.params.relight.model_copy(update=update)
        folders = (bench.input("splat"), bench.input("fuse"), bench.input("masks"))
        return _Lights(load_capture(bench.input("capture")), folders, settings, bench.scratch)

    return prepare


def _fit_lights(prepared: _Lights, choice: Choice, repeat: int) -> Work:
    settings = prepared.settings.model_copy(update=choice.section("relight"))
    with stopwatch() as watch:
        result = fit_lights(
            prepared.capture, *prepared.folders, prepared.scratch / "relight", settings,
            seed=repeat, quiet=True, log=_mute,
        )  # fmt: skip
    return watch.work(_rmse(result.metrics["psnr_lights"]))


LIGHT_STEPS = Knob(
    name="iterations of light on frozen geometry",
    work="lights fitted",
    choices=tuple(
        Choice(str(n), {"relight.frozen_iterations": n})
        for n in around(RelightSettings().frozen_iterations, 0.25, 0.5, 1, 2)
    ),
    error="RMS error of single lamps in held-out views, display 0..1",
    why="Once geometry is frozen the lights settle quickly; the default is past the bend.",
    prepare=_prepare_lights(joint_iterations=100),
    run=_fit_lights,
)

CACHE = Knob(
    name="cached blending weights",
    work="lights fitted",
    choices=(
        Choice("cached", {"relight.max_baked_mb": RelightSettings().max_baked_mb}),
        Choice("rasterized every time", {"relight.max_baked_mb": 0}),
    ),
    error="RMS error of single lamps in held-out views, display 0..1",
    why="Frozen geometry blends with the same weights every time, so they are kept.",
    prepare=_prepare_lights(joint_iterations=50),
    run=_fit_lights,
)
