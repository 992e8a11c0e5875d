"""A rendered room becomes a capture whose truth is known: lights, geometry and masks.

The photo of a view is AgX(g · (ambient + Σ on_i · scale_i · light_i)), one exposure g for all.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from luxcore.cameras import Camera
from luxcore.capture.depth_points import points_from_distance
from luxcore.capture.points import Points
from luxcore.capture.store import Capture, View, checked_camera, write_capture
from luxcore.errors import FormatError, InputError
from luxcore.files.atomic import write_json
from luxcore.files.exr import read_exr
from luxcore.files.json_object import read_object
from luxcore.light.agx import agx
from luxcore.settings.capture import CaptureSettings

Layers = dict[str, np.ndarray]


def from_rendered(
    render_demo_dir: Path,
    out: Path,
    settings: CaptureSettings,
    *,
    capture_id: str | None = None,
) -> Capture:
    """Make a capture with truth of the perspective views in `render_demo_dir`/views.

    Raises InputError when there are none, FormatError when a view is incomplete.
    """
    views = rendered_views(render_demo_dir)
    abouts = [read_object(path) for path in views]
    # One exposure for the whole capture, as a photographer who wants to compare views sets it.
    exposure = float(
        np.median([_number(p, a, "exposure") for p, a in zip(views, abouts, strict=True)])
    )
    photos = [_photo(path, exposure) for path in views]
    return write_capture(
        out,
        Path(out).name if capture_id is None else capture_id,
        photos,
        _points(views, photos, settings.points),
        source="rendered",
        metric=True,
        exposure=exposure,
        write_truth=lambda folder: _write_truth(folder, views, abouts[0], exposure),
    )


def rendered_views(render_demo_dir: Path) -> list[Path]:
    """The JSON files of the rendered views, in view order."""
    folder = Path(render_demo_dir) / "views"
    views = sorted(folder.glob("[0-9][0-9][0-9][0-9].json"))
    if not views:
        raise InputError(f"{folder} holds no rendered views.")
    return views


def input_linear(path: Path, about: dict[str, Any], layers: Layers) -> Float[np.ndarray, "h w 3"]:
    """The light of the photo as taken: ambient + Σ on_i · scale_i · light_i, linear Rec.709."""
    try:
        image = layers["ambient"][..., :3].astype(np.float32)
        for index, lamp in enumerate(about["lamps"]):
            if lamp["on"]:
                image = image + np.float32(lamp["scale"]) * layers[f"light_{index:02d}"][..., :3]
    except (KeyError, TypeError) as error:
        raise FormatError(f"{path} and its EXR do not agree: {error} is missing.") from error
    return image


def _photo(path: Path, exposure: float) -> View:
    about = read_object(path)
    light = input_linear(path, about, read_exr(path.with_suffix(".exr")))
    photo = agx(light * np.float32(exposure))
    return View(f"{path.stem}.png", photo, _camera(path, about))


def _points(views: list[Path], photos: list[View], limit: int) -> Points:
    def clouds() -> Iterator[Points]:
        for path, view in zip(views, photos, strict=True):
            geometry = read_exr(path.with_name(f"{path.stem}.geometry.exr"))
            if "ray_distance_m" not in geometry:
                raise FormatError(f"{path.stem}.geometry.exr lacks the part ray_distance_m.")
            distance = geometry["ray_distance_m"][..., 0]
            yield points_from_distance(distance, view.photo, view.camera, limit // len(views))

    xyz, rgb = zip(*clouds(), strict=True)
    return Points(np.concatenate(xyz), np.concatenate(rgb))


def _write_truth(folder: Path, views: list[Path], about: dict[str, Any], exposure: float) -> None:
    for index, path in enumerate(views):
        for kind in (".exr", ".geometry.exr", ".masks.exr"):
            origin = path.with_name(path.stem + kind)
            if not origin.is_file():
                raise InputError(f"{origin} does not exist.")
            shutil.copyfile(origin, folder / f"{index:04d}{kind}")
    lights = {"exposure": exposure, "lamps": about["lamps"], "room": about.get("room")}
    write_json(folder / "lights.json", lights)


def _camera(path: Path, about: dict[str, Any]) -> Camera:
    record = about.get("camera")
    if not isinstance(record, dict):
        raise FormatError(f"{path} lacks a camera.")
    return checked_camera(path, {"file_path": path.stem, **record}, {})


def _number(path: Path, about: dict[str, Any], key: str) -> float:
    value = about.get(key)
    if not isinstance(value, int | float) or not value > 0:
        raise FormatError(f"{path} must give a positive {key}, got {value!r:.40}.")
    return float(value)
