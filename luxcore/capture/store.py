"""A capture on disk: undistorted photos, cameras, points and, for rendered rooms, the truth.

transforms.json   nerfstudio cameras, one frame per view in view order
images/0000.png   undistorted, display-referred photos
points.ply        structure from motion or depth points
capture.json      id, metric, exposure, source, views, skipped
truth/            rendered rooms only: 0000.exr, 0000.geometry.exr, 0000.masks.exr, lights.json
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from luxcore.cameras import Camera, camera_from_nerfstudio, camera_to_nerfstudio
from luxcore.capture.names import check_id, inside
from luxcore.capture.points import Points, read_points, write_points
from luxcore.errors import FormatError, InputError
from luxcore.files.atomic import atomic_folder, write_json
from luxcore.files.json_numbers import flag, positive
from luxcore.files.json_object import read_object
from luxcore.files.photos import write_png


@dataclass(frozen=True)
class Frame:
    """One view: `name` is that of the photo it came from."""

    name: str
    image_path: Path
    camera: Camera


@dataclass(frozen=True)
class Skipped:
    """A photo that is not part of the capture, and why."""

    name: str
    reason: str


@dataclass(frozen=True)
class Capture:
    """A room seen from several places. Poses are OpenCV c2w, world z up."""

    id: str
    root: Path
    frames: tuple[Frame, ...]
    points: Points
    metric: bool
    """Whether one unit is one metre; else the scale is arbitrary."""
    exposure: float | None
    """g of image = AgX(g · radiance), where it is known (rendered rooms)."""
    source: str
    skipped: tuple[Skipped, ...] = ()

    @property
    def truth(self) -> Path | None:
        """Folder with the true lights, geometry and masks of a rendered room."""
        folder = self.root / "truth"
        return folder if folder.is_dir() else None

    @property
    def drawn_masks(self) -> Path | None:
        """Folder with the lamp masks that the user drew."""
        folder = self.root / "masks"
        return folder if folder.is_dir() else None


@dataclass(frozen=True)
class View:
    """One view on its way into a capture: photo [H, W, 3], display-referred, 0..1."""

    name: str
    photo: Float[np.ndarray, "h w 3"]
    camera: Camera


def write_capture(
    folder: Path,
    capture_id: str,
    views: Iterable[View],
    points: Points,
    *,
    source: str,
    metric: bool,
    exposure: float | None = None,
    skipped: Iterable[Skipped] = (),
    write_truth: Callable[[Path], None] | None = None,
    write_masks: Callable[[Path], None] | None = None,
) -> Capture:
    """Write a whole capture or nothing; `write_truth` and `write_masks` fill those folders."""
    check_id(capture_id)
    with atomic_folder(Path(folder)) as temporary:
        frames = [_write_view(temporary, index, view) for index, view in enumerate(views)]
        write_json(temporary / "transforms.json", {"camera_model": "PINHOLE", "frames": frames})
        write_points(temporary / "points.ply", points)
        about = {
            "id": capture_id,
            "metric": metric,
            "exposure": exposure,
            "source": source,
            "views": len(frames),
            "skipped": [{"name": s.name, "reason": s.reason} for s in skipped],
        }
        write_json(temporary / "capture.json", about)
        for name, fill in (("truth", write_truth), ("masks", write_masks)):
            if fill is not None:
                (temporary / name).mkdir()
                fill(temporary / name)
    return load_capture(Path(folder))


def load_capture(folder: Path) -> Capture:
    """Read a capture. Raises InputError or FormatError naming the file and the fact."""
    folder = Path(folder)
    about_path, transforms_path = folder / "capture.json", folder / "transforms.json"
    about = read_object(about_path)
    frames = tuple(_load_frames(folder, transforms_path))
    if not frames:
        raise FormatError(f"{transforms_path} holds no frames.")
    try:
        return Capture(
            id=check_id(about["id"]),
            root=folder,
            frames=frames,
            points=read_points(folder / "points.ply"),
            metric=flag(about["metric"], "metric"),
            exposure=_exposure(about["exposure"]),
            source=str(about["source"]),
            skipped=tuple(Skipped(s["name"], s["reason"]) for s in about["skipped"]),
        )
    except (KeyError, TypeError) as error:
        raise FormatError(f"{about_path} lacks a usable {error}.") from error
    except ValueError as error:
        raise FormatError(f"{about_path}: {error}.") from error


def frame_records(path: Path, transforms: dict[str, Any]) -> list[dict[str, Any]]:
    """The `frames` list of a nerfstudio file, each checked to be an object naming a file."""
    frames = transforms.get("frames")
    if not isinstance(frames, list) or not all(isinstance(f, dict) for f in frames):
        raise FormatError(f"{path} must hold a list of frames.")
    for index, frame in enumerate(frames):
        if not isinstance(frame.get("file_path"), str):
            raise FormatError(f"{path}: frame {index} lacks a file_path.")
    return frames


def checked_camera(path: Path, frame: dict[str, Any], shared: dict[str, Any]) -> Camera:
    """The camera of a frame; a bad one is reported with the file and the frame's picture."""
    try:
        return camera_from_nerfstudio(frame, shared)
    except InputError as error:
        raise FormatError(f"{path}: {frame['file_path']:.80}: {error}") from error


def _exposure(value: Any) -> float | None:
    return None if value is None else positive(value, "exposure")


def _write_view(folder: Path, index: int, view: View) -> dict[str, Any]:
    height, width = view.photo.shape[:2]
    if (width, height) != (view.camera.width, view.camera.height):
        raise InputError(
            f"{view.name} is {width}x{height}, "
            f"its camera is {view.camera.width}x{view.camera.height}."
        )
    file_path = f"images/{index:04d}.png"
    write_png(folder / file_path, view.photo)
    return {"file_path": file_path, "name": view.name, **camera_to_nerfstudio(view.camera)}


def _load_frames(folder: Path, path: Path) -> Iterable[Frame]:
    transforms = read_object(path)
    for record in frame_records(path, transforms):
        image_path = inside(folder, record["file_path"], path)
        if not image_path.is_file():
            raise FormatError(f"{path} names {record['file_path']}, which does not exist.")
        camera = checked_camera(path, record, transforms)
        yield Frame(str(record.get("name", image_path.name)), image_path, camera)
