"""Whatever the user has of a room (photos, with poses or without) becomes a capture."""

from __future__ import annotations

import shutil
import tempfile
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from luxcore.capture.colmap_files import find_model, read_model
from luxcore.capture.drawn_masks import FOLDER as DRAWN
from luxcore.capture.drawn_masks import carry_masks
from luxcore.capture.names import check_id, inside
from luxcore.capture.nerfstudio import read_nerfstudio
from luxcore.capture.orientation import room_like
from luxcore.capture.photo_folder import StagedPhoto, find_photos, stage_photos
from luxcore.capture.points import Points
from luxcore.capture.posed import PosedPhoto, to_views
from luxcore.capture.sfm import solve_poses
from luxcore.capture.sparse import SparseModel
from luxcore.capture.store import Capture, Skipped, load_capture, write_capture
from luxcore.capture.triangulate import triangulate
from luxcore.errors import InputError
from luxcore.files.atomic import atomic_folder
from luxcore.files.photos import write_png
from luxcore.settings.capture import CaptureSettings


@dataclass(frozen=True)
class _Found:
    """What a source gave, before it is written."""

    kind: str
    photos: list[PosedPhoto]
    points: Points
    order: tuple[str, ...]
    """Names of all photos of the source, placed or not."""
    skipped: tuple[Skipped, ...] = ()


def ingest(
    source: Path,
    out: Path,
    settings: CaptureSettings,
    seed: int,
    *,
    capture_id: str | None = None,
) -> Capture:
    """Write the capture `out` from `source`, whole or not at all.

    `source` is a capture, a nerfstudio folder, a COLMAP project, or a folder of photos, with the
    user's lamp masks in masks/NNNN_LL.png where there are any. The id is
    the name of `out` unless given; a capture that is copied keeps its own.
    Raises InputError for what cannot be used, LuxError when too few views can be placed.
    """
    source, out = Path(source), Path(out)
    identifier = check_id(out.name if capture_id is None else capture_id)
    if not source.is_dir():
        raise InputError(f"{source} is not a folder.")
    if (source / "capture.json").is_file():
        return _copy(source, out)
    if (source / "transforms.json").is_file():
        photos, points = read_nerfstudio(source / "transforms.json")
        found = _Found("nerfstudio", photos, points, tuple(p.name for p in photos))
        return _write(source, found, out, identifier, settings, seed)
    model = find_model(source)
    if model is not None:
        return _from_colmap(source, model, out, identifier, settings, seed)
    return _from_photos(source, out, identifier, settings, seed)


def placed_sentence(capture: Capture) -> str:
    """For example "19 of 20 views placed (unreadable.jpg: not a readable picture)"."""
    total = len(capture.frames) + len(capture.skipped)
    sentence = f"{len(capture.frames)} of {total} views placed"
    if capture.skipped:
        sentence += f" ({'; '.join(f'{s.name}: {s.reason}' for s in capture.skipped)})"
    return sentence


def _copy(source: Path, out: Path) -> Capture:
    load_capture(source)
    with atomic_folder(out) as temporary:
        shutil.copytree(source, temporary, dirs_exist_ok=True)
    return load_capture(out)


def _from_colmap(
    source: Path, model: Path, out: Path, identifier: str, settings: CaptureSettings, seed: int
) -> Capture:
    root = next(f for f in (source / "images", source) if f.is_dir())
    sparse = read_model(model, root)
    files = {image.name: inside(root, image.name, model) for image in sparse.images}
    photos, points = _room_like(sparse, files, {})
    found = _Found("colmap", photos, points, tuple(p.name for p in photos))
    return _write(source, found, out, identifier, settings, seed)


def _from_photos(
    source: Path, out: Path, identifier: str, settings: CaptureSettings, seed: int
) -> Capture:
    photos = find_photos(source)
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        (work / "images").mkdir()
        staged, skipped = stage_photos(photos, work / "images", settings.image_side)
        _check_enough(source, staged, skipped, settings)
        sparse = read_model(solve_poses(staged, work, settings, seed), work / "images")
        placed = {image.name for image in sparse.images}
        unplaced = [p for p in staged if p.path.name not in placed]
        skipped += [Skipped(p.name, "could not be placed") for p in unplaced]
        files = {p.path.name: p.path for p in staged}
        names = {p.path.name: p.name for p in staged}
        posed, points = _room_like(sparse, files, names)
        order = tuple(path.name for path in photos)
        found = _Found("photos", posed, points, order, tuple(skipped))
        return _write(source, found, out, identifier, settings, seed)


def _check_enough(
    source: Path, staged: list[StagedPhoto], skipped: list[Skipped], settings: CaptureSettings
) -> None:
    if len(staged) >= settings.min_views:
        return
    unusable = ""
    if skipped:
        unusable = f" and {len(skipped)} unusable ({skipped[0].name}: {skipped[0].reason})"
    raise InputError(
        f"{source} holds {len(staged)} readable photo{'s' * (len(staged) != 1)}{unusable}; "
        f"at least {settings.min_views} are needed."
    )


def _room_like(
    sparse: SparseModel, files: dict[str, Path], names: dict[str, str]
) -> tuple[list[PosedPhoto], Points]:
    """COLMAP's world has neither up nor metres: turn it upright and scale it like a room."""
    c2w = np.stack([np.linalg.inv(image.w2c) for image in sparse.images])
    world = room_like(c2w, sparse.points.xyz.astype(float))
    xyz = world.points(sparse.points.xyz.astype(float)).astype(np.float32)
    photos = [
        PosedPhoto(names.get(i.name, i.name), files[i.name], i.lens, world.pose(pose))
        for i, pose in zip(sparse.images, c2w, strict=True)
    ]
    return photos, Points(xyz, sparse.points.rgb)


def _write(
    source: Path,
    found: _Found,
    out: Path,
    identifier: str,
    settings: CaptureSettings,
    seed: int,
) -> Capture:
    points = found.points
    if len(points.xyz) == 0:
        points = _missing_points(found.photos, settings, seed)
    drawn, write_masks = source / DRAWN, None
    if drawn.is_dir():
        write_masks = partial(carry_masks, drawn, found.order, found.photos, settings.image_side)
    return write_capture(
        out,
        identifier,
        to_views(found.photos, settings.image_side),
        points,
        source=found.kind,
        metric=False,
        skipped=found.skipped,
        write_masks=write_masks,
    )


def _missing_points(photos: list[PosedPhoto], settings: CaptureSettings, seed: int) -> Points:
    """Poses came without points, but the splats start from points."""
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        staged, cameras = [], []
        for index, view in enumerate(to_views(photos, settings.image_side)):
            path = work / "images" / f"{index:04d}.png"
            write_png(path, view.photo)
            size = view.camera.width, view.camera.height
            staged.append(StagedPhoto(view.name, path, *size, view.camera.fx))
            cameras.append(view.camera)
        return triangulate(staged, cameras, work, settings, seed)
