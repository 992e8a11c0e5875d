"""Stage 1: Gaussians of a room from its photos (Kerbl et al. 2023; the supplement, "Stage 1").

Photos are display-referred and so are the colours fitted here; linear light comes in stage 2.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from luxcore.capture import Capture
from luxcore.errors import DivergedError
from luxcore.files.atomic import write_json
from luxcore.files.digests import file_digest, value_digest
from luxcore.files.exr import write_exr
from luxcore.progress import progress
from luxcore.settings.splat import SplatSettings
from luxcore.splats.checkpoint import CheckpointFolder
from luxcore.splats.density import (
    McmcSettings,
    McmcStrategy,
    StandardSettings,
    StandardStrategy,
    Strategy,
)
from luxcore.splats.device import Device, open_device
from luxcore.splats.geometry import expected_depth, normals_from_depth
from luxcore.splats.geometry_fit import GeometryFit
from luxcore.splats.initial import initial_gaussians, random_points, scene_extent
from luxcore.splats.ply import write_ply
from luxcore.splats.rates import Rates
from luxcore.splats.views import Split, Views, load_views, split_views

_VERSION = 2
"""Raised when the same settings would no longer give the same Gaussians."""
_DENSITY_START, _DENSITY_STOP = 0.08, 0.65
"""Shares of a run between which Gaussians are added and removed; the rest only settles them."""
_DENSITY_STEPS = 12
_GROWN_AT = 0.7
"""Share of the refinements after which MCMC has reached the cap."""
_HARMONICS_AT = 0.7

Log = Callable[[str], None]


@dataclass(frozen=True)
class CurvePoint:
    """Held-out quality after `iteration` iterations and `seconds` of work."""

    iteration: int
    seconds: float
    psnr_heldout: float
    gaussians: int


@dataclass(frozen=True)
class Stage1Result:
    """Metrics that depend on the input alone, and the curve, whose seconds do not."""

    metrics: dict[str, float]
    curve: tuple[CurvePoint, ...]


def fit_geometry(
    capture: Capture,
    out: Path,
    settings: SplatSettings,
    *,
    seed: int = 0,
    checkpoint: Path | None = None,
    quiet: bool = False,
    log: Log = print,
) -> Stage1Result:
    """Fit Gaussians to a capture and write splats.ply, depth/, metrics.json, curve.json to `out`.

    With a `checkpoint` folder a killed run continues where it was, to the same bits. Held-out
    views are measured; where a capture is too small to hold any out, the training views are.
    Raises DivergedError when the fit stops being finite.
    """
    device = open_device()
    views = load_views(device, capture.frames, settings.max_side)
    split = split_views(len(views.cameras), settings.holdout_every)
    fit = _prepare(device, capture, views, split, settings, seed)
    folder = CheckpointFolder(checkpoint, _run_key(capture, settings, seed)) if checkpoint else None
    curve = _run(fit, settings, folder, capture.id, quiet, log)
    metrics = _write(fit, capture, out, curve)
    if folder is not None:
        folder.clear()
    return Stage1Result(metrics, tuple(curve))


def _prepare(
    device: Device, capture: Capture, views: Views, split: Split, settings: SplatSettings, seed: int
) -> GeometryFit:
    random = np.random.Generator(np.random.PCG64([seed, 0]))
    xyz, rgb = capture.points
    if not len(xyz):
        xyz, rgb = random_points(views.cameras, settings.initial_gaussians, random)
    extent = scene_extent(xyz, views.cameras)
    limit = min(settings.initial_gaussians, settings.max_gaussians)
    gaussians = initial_gaussians(xyz, rgb, extent, limit, random)
    gaussians = replace(gaussians, antialiased=settings.antialiased)
    rates = Rates.for_scene(extent, settings.rate_scale)
    strategy = _strategy(device, extent, rates, settings, seed, len(gaussians))
    fit = GeometryFit(
        device, views, split, gaussians, strategy, rates,
        iterations=settings.iterations, ssim_weight=settings.ssim_weight, seed=seed,
    )  # fmt: skip
    if settings.sh_degree:
        fit.set_degree(settings.sh_degree)
    return fit


def _strategy(
    device: Device, extent: float, rates: Rates, settings: SplatSettings, seed: int, count: int
) -> Strategy:
    start, stop = (int(settings.iterations * share) for share in (_DENSITY_START, _DENSITY_STOP))
    every = max(1, (stop - start) // _DENSITY_STEPS)
    cap = settings.max_gaussians
    if settings.density == "mcmc":
        growth = max((cap / max(count, 1)) ** (1 / (_GROWN_AT * _DENSITY_STEPS)), 1.05)
        chain = McmcSettings(start, stop, every, cap, growth=min(growth, 2.0))
        return McmcStrategy(device, extent, rates.means, seed, chain)
    return StandardStrategy(device, extent, StandardSettings(start, stop, every, cap))


def _run(
    fit: GeometryFit,
    settings: SplatSettings,
    folder: CheckpointFolder | None,
    name: str,
    quiet: bool,
    log: Log,
) -> list[CurvePoint]:
    curve, start = _resume(fit, folder), time.monotonic()
    spent = curve[-1].seconds if curve else 0.0
    if settings.sh_degree is not None:
        log(f"spherical harmonics: degree {settings.sh_degree}, as the settings say")
    ask_at = int(settings.iterations * _HARMONICS_AT) if settings.sh_degree is None else -1
    with progress(f"splat {name}", settings.iterations, quiet=quiet) as bar:
        bar.advance(fit.done)
        while fit.done < settings.iterations:
            fit.step()
            if fit.done == ask_at:
                log(fit.ask_for_harmonics().reason)
            if fit.done % settings.curve_every == 0 or fit.done == settings.iterations:
                curve.append(_measure(fit, spent + time.monotonic() - start))
                bar.advance(1, psnr=f"{curve[-1].psnr_heldout:.1f}", gaussians=fit.model.count)
            else:
                bar.advance(1)
            if folder is not None and fit.done % settings.checkpoint_every == 0:
                folder.save(fit.done, {**fit.state(), "curve": _curve_array(curve)})
    return curve


def _resume(fit: GeometryFit, folder: CheckpointFolder | None) -> list[CurvePoint]:
    saved = folder.load() if folder is not None else None
    if saved is None:
        return []
    done, state = saved
    rows = state.pop("curve")
    fit.load(done, state)
    return [CurvePoint(int(i), float(s), float(p), int(n)) for i, s, p, n in rows]


def _curve_array(curve: Sequence[CurvePoint]) -> np.ndarray:
    rows = [[p.iteration, p.seconds, p.psnr_heldout, p.gaussians] for p in curve]
    return np.array(rows, np.float64).reshape(-1, 4)


def _measure(fit: GeometryFit, seconds: float) -> CurvePoint:
    views = fit.split.held_out or fit.split.training
    quality = float(np.mean(fit.measure(views)))
    if not np.isfinite(fit.model.download().means).all():
        raise DivergedError(f"the splats stopped being finite by iteration {fit.done}.")
    return CurvePoint(fit.done, seconds, quality, fit.model.count)


def _write(
    fit: GeometryFit, capture: Capture, out: Path, curve: Sequence[CurvePoint]
) -> dict[str, float]:
    write_ply(out / "splats.ply", fit.model.download())
    for index, frame in enumerate(capture.frames):
        rendered = fit.render(frame.camera)
        depth_m = expected_depth(rendered.depth.get(), rendered.alpha.get())
        layers = {"depth_m": depth_m, "normal": normals_from_depth(depth_m, frame.camera)}
        write_exr(out / "depth" / f"{index:04d}.exr", layers, half=False)
    counts = {
        "iterations": fit.done,
        "gaussians": fit.model.count,
        "sh_degree": fit.degree,
        "views": len(fit.views.cameras),
        "views_heldout": len(fit.split.held_out),
    }
    metrics = {
        **{name: float(count) for name, count in counts.items()},
        "psnr_training": float(np.mean(fit.measure(fit.split.training))),
    }
    if fit.split.held_out:
        metrics["psnr_heldout"] = float(np.mean(fit.measure(fit.split.held_out)))
    points = [{k: v for k, v in asdict(p).items() if k != "seconds"} for p in curve]
    write_json(out / "curve.json", points)
    write_json(out / "metrics.json", metrics)
    return metrics


def _run_key(capture: Capture, settings: SplatSettings, seed: int) -> str:
    """What a checkpoint must have been made for: the photos, the cameras, the settings."""
    files = [capture.root / "transforms.json", capture.root / "points.ply"]
    digests = [file_digest(f) for f in (*files, *(f.image_path for f in capture.frames))]
    return value_digest([_VERSION, digests, settings.model_dump(mode="json"), seed])
