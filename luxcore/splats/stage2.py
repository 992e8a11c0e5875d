"""Stage 2: linear light of every lamp on every Gaussian (the supplement, "Stage 2").

Geometry and lights are refined together, then geometry is frozen and the lights alone are fitted,
so that no light is explained by moving Gaussians.
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
from luxcore.files.photos import write_png
from luxcore.light.agx import agx
from luxcore.masks.store import Lamp, load_masks
from luxcore.progress import progress
from luxcore.settings.relight import RelightSettings
from luxcore.splats.checkpoint import CheckpointFolder
from luxcore.splats.device import open_device
from luxcore.splats.initial import scene_extent
from luxcore.splats.light_fit import LightFit
from luxcore.splats.light_quality import LightQuality
from luxcore.splats.light_views import load_light_views, read_exposure
from luxcore.splats.ply import read_ply
from luxcore.splats.rates import Rates
from luxcore.splats.relighting import baked_gaussians, render_scene, solo
from luxcore.splats.scene import Scene, SceneLamp, SceneTone, save_scene
from luxcore.splats.views import split_views

_VERSION = 3
"""Raised when the same settings would no longer give the same lights."""
_THUMBNAIL_SIDE = 160

Log = Callable[[str], None]


@dataclass(frozen=True)
class LightCurvePoint:
    """Quality after `iteration` iterations and `seconds` of work."""

    iteration: int
    seconds: float
    psnr_lights: float
    """Held-out views, mean over lights, AgX display, dB."""


@dataclass(frozen=True)
class Stage2Result:
    """Metrics that depend on the input alone, and the curve, whose seconds do not."""

    metrics: dict[str, float]
    curve: tuple[LightCurvePoint, ...]


def fit_lights(
    capture: Capture,
    stage1_dir: Path,
    fuse_dir: Path,
    masks_dir: Path,
    out: Path,
    settings: RelightSettings,
    *,
    seed: int = 0,
    checkpoint: Path | None = None,
    quiet: bool = False,
    log: Log = print,
) -> Stage2Result:
    """Fit the lights of the fuse stage onto the Gaussians of stage 1 and write a scene to `out`.

    With a `checkpoint` folder a killed run continues where it was, to the same bits.
    Raises DivergedError when the fit stops being finite.
    """
    lamps = load_masks(masks_dir).lamps
    fit = open_light_fit(capture, stage1_dir, fuse_dir, lamps, settings, seed)
    key = _run_key(capture, stage1_dir, fuse_dir, lamps, settings, seed)
    folder = CheckpointFolder(checkpoint, key) if checkpoint else None
    quality = LightQuality(fit)
    curve = _run(fit, quality, settings, folder, capture.id, quiet)
    scene = _scene(fit, capture, lamps)
    log(_mixing_line(scene))
    counts = {
        "gaussians": fit.model.count,
        "iterations": fit.done,
        "views": scene.views,
        "views_heldout": len(fit.split.held_out),
    }
    metrics = {**quality.metrics(), **{name: float(count) for name, count in counts.items()}}
    _write(scene, fit, capture, out, metrics, curve)
    if folder is not None:
        folder.clear()
    return Stage2Result(metrics, tuple(curve))


def open_light_fit(
    capture: Capture,
    stage1_dir: Path,
    fuse_dir: Path,
    lamps: Sequence[Lamp],
    settings: RelightSettings,
    seed: int,
) -> LightFit:
    """A fit of the lights of `fuse_dir` onto the Gaussians of `stage1_dir`, before its first
    step."""
    device = open_device()
    views = load_light_views(device, capture, fuse_dir, len(lamps), settings.max_side)
    gaussians = read_ply(stage1_dir / "splats.ply")
    extent = scene_extent(gaussians.means, views.cameras)
    return LightFit(
        device,
        views,
        split_views(len(views.cameras), settings.holdout_every),
        gaussians,
        [lamp.on for lamp in lamps],
        Rates.for_scene(extent, settings.geometry_rate_scale),
        settings,
        exposure=read_exposure(fuse_dir, capture),
        seed=seed,
    )


def _run(
    fit: LightFit,
    quality: LightQuality,
    settings: RelightSettings,
    folder: CheckpointFolder | None,
    name: str,
    quiet: bool,
) -> list[LightCurvePoint]:
    curve, start = _resume(fit, folder), time.monotonic()
    spent = curve[-1].seconds if curve else 0.0
    iterations = settings.joint_iterations + settings.frozen_iterations
    with progress(f"relight {name}", iterations, quiet=quiet) as bar:
        bar.advance(fit.done)
        while fit.done < iterations:
            fit.step()
            if fit.done % settings.curve_every == 0 or fit.done == iterations:
                curve.append(_measure_curve(fit, quality, spent + time.monotonic() - start))
                bar.advance(1, psnr=f"{curve[-1].psnr_lights:.1f}")
            else:
                bar.advance(1)
            if folder is not None and fit.done % settings.checkpoint_every == 0:
                rows = [[p.iteration, p.seconds, p.psnr_lights] for p in curve]
                array = np.array(rows, np.float64).reshape(-1, 3)
                folder.save(fit.done, {**fit.state(), "curve": array})
    return curve


def _resume(fit: LightFit, folder: CheckpointFolder | None) -> list[LightCurvePoint]:
    saved = folder.load() if folder is not None else None
    if saved is None:
        return []
    done, state = saved
    rows = state.pop("curve")
    fit.load(done, state)
    return [LightCurvePoint(int(i), float(s), float(p)) for i, s, p in rows]


def _measure_curve(fit: LightFit, quality: LightQuality, seconds: float) -> LightCurvePoint:
    if not np.isfinite(fit.lights.get()).all() or not np.isfinite(fit.params.get()).all():
        raise DivergedError(f"the lights stopped being finite by iteration {fit.done}.")
    return LightCurvePoint(fit.done, seconds, quality.psnr_lights())


def _scene(fit: LightFit, capture: Capture, lamps: Sequence[Lamp]) -> Scene:
    weights, curve = fit.mixing()
    # A lamp that was off has no scale factor in any photo: its own radiance is the best guess.
    scales = (w if lamp.on else np.ones(3) for w, lamp in zip(weights[1:], lamps, strict=True))
    scene = Scene(
        name=capture.id,
        gaussians=fit.model.download(),
        radiance=fit.radiance(),
        lamps=tuple(
            SceneLamp(lamp.index, lamp.name, lamp.on, _three(scale))
            for lamp, scale in zip(lamps, scales, strict=True)
        ),
        ambient_scale=_three(weights[0]),
        tone=SceneTone(fit.exposure, curve.beta, curve.gamma),
        views=len(capture.frames),
        metric=capture.metric,
    )
    return replace(scene, gaussians=baked_gaussians(scene))


def _write(
    scene: Scene,
    fit: LightFit,
    capture: Capture,
    out: Path,
    metrics: dict[str, float],
    curve: Sequence[LightCurvePoint],
) -> None:
    cameras = [frame.camera for frame in capture.frames]
    save_scene(out, scene, cameras)
    longest = max(cameras[0].width, cameras[0].height)
    scale = min(1.0, _THUMBNAIL_SIDE / longest)
    small = cameras[0].resized(
        max(1, round(cameras[0].width * scale)), max(1, round(cameras[0].height * scale))
    )
    for lamp in scene.lamps:
        image = render_scene(scene, small, solo(scene, lamp.name))
        write_png(out / "thumbnails" / f"lamp_{lamp.index}.png", agx(scene.tone.exposure * image))
    points = [{k: v for k, v in asdict(p).items() if k != "seconds"} for p in curve]
    write_json(out / "curve.json", points)
    write_json(out / "metrics.json", metrics)


def _mixing_line(scene: Scene) -> str:
    parts = [f"ambient {np.round(scene.ambient_scale, 2).tolist()}"]
    parts += [f"{lamp.name} {np.round(lamp.scale, 2).tolist()}" for lamp in scene.lamps]
    tone = f"gamma {scene.tone.gamma:.2f}, beta {scene.tone.beta:.4f}"
    return f"scale factors: {', '.join(parts)}; tone curve: {tone}"


def _three(values: np.ndarray) -> tuple[float, float, float]:
    red, green, blue = (float(value) for value in values)
    return red, green, blue


def _run_key(
    capture: Capture,
    stage1_dir: Path,
    fuse_dir: Path,
    lamps: Sequence[Lamp],
    settings: RelightSettings,
    seed: int,
) -> str:
    files = [stage1_dir / "splats.ply", capture.root / "transforms.json", fuse_dir / "fuse.json"]
    files += [fuse_dir / f"{index:04d}.exr" for index in range(len(capture.frames))]
    files += [frame.image_path for frame in capture.frames]
    digests = [file_digest(f) for f in files]
    shone = [[lamp.name, lamp.on] for lamp in lamps]
    return value_digest([_VERSION, digests, shone, settings.model_dump(mode="json"), seed])
