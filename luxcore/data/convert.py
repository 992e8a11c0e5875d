"""Between our compact form and the public layout, both ways, and photos out to other tools."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from luxcore.cameras import Camera, camera_to_nerfstudio
from luxcore.data.compact import save_rendered
from luxcore.data.crops import LitCrop
from luxcore.data.layouts import views_in
from luxcore.data.multiview import MultiViewSets
from luxcore.data.public_reader import PublicScene, open_scenes
from luxcore.data.public_writer import AS_TAKEN_PASS, write_scene
from luxcore.data.rotations import quaternion_from_matrix
from luxcore.data.store import AnyView, by_room, load_view
from luxcore.errors import InputError, LuxError
from luxcore.files.atomic import atomic_folder, write_json
from luxcore.files.exr import write_exr
from luxcore.files.photos import write_png
from luxcore.light.agx import agx
from luxcore.progress import progress

SCENE_DIGITS = 6
Held = TypeVar("Held")
_ROOM = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9_.-]{0,63}")
"""A room's name comes out of a file: as a folder it must stay below `out`."""


@dataclass(frozen=True)
class Converted:
    """What was written, and the rooms that were left out, each with the cause.

    A room is converted whole or not at all; one that cannot be read does not stop the others.
    """

    written: list[Path]
    failed: dict[str, str]


def compact_to_public(
    stems: Sequence[Path], root: Path, *, first_scene: int = 0, seed: int = 0
) -> Converted:
    """One public scene per room, numbered from `first_scene` in the order of `stems`.

    A room that is left out leaves its number free. Raises InputError when six digits are too few.
    """
    rooms = by_room(stems)
    numbers = {room: f"{number:06d}" for number, room in enumerate(rooms, start=first_scene)}
    if max(map(len, numbers.values()), default=0) > SCENE_DIGITS:
        raise InputError(f"{len(rooms)} scenes from {first_scene} on go beyond six digits.")

    def write(room: str, members: Sequence[AnyView]) -> list[Path]:
        views = [load_view(member) for member in members]
        return [write_scene(root, numbers[room], views, seed=seed)]

    return _each("public layout", "scenes", rooms, write)


def public_to_compact(path: Path, out: Path) -> Converted:
    """Every view of the scenes at `path` (shards or folders) as `out`/SSSSSS_V, by its stem.

    The photo is the mix "as taken" where the scene has it, else the full mix.
    """

    def write(_: str, scene: PublicScene) -> list[Path]:
        mix = AS_TAKEN_PASS if AS_TAKEN_PASS in scene.mix_passes else 0
        views = {view: scene.read_view(view, mix) for view in scene.views}
        stems = [Path(out) / f"{scene.scene_id}_{view}" for view in views]
        for view, stem in zip(views.values(), stems, strict=True):
            save_rendered(view, stem)
        return stems

    return _each("compact form", "scenes", {s.scene_id: s for s in open_scenes(path)}, write)


def cut_photos(
    source: Path, out: Path, *, photos: int, size: tuple[int, int], seed: int = 0
) -> Converted:
    """`photos` overlapping perspective photos of every room of `source` as `out`/ROOM.

    `source`: views in either form; `size` is (height, width). See `export_photos`.
    """
    views = views_in(source)

    def write(room: str, members: Sequence[AnyView]) -> list[Path]:
        if not _ROOM.fullmatch(room):
            raise InputError(f"{source}: a room called {room!r:.80} cannot be a folder.")
        sets = MultiViewSets(members, size, seed, relit=False, mask_kinds=("fixture",))
        return [export_photos(sets.crops(0, photos), Path(out) / room)]

    return _each("photos", "rooms", by_room(views), write)


def _each(
    label: str, unit: str, rooms: Mapping[str, Held], write: Callable[[str, Held], list[Path]]
) -> Converted:
    done = Converted([], {})
    with progress(label, len(rooms), unit) as bar:
        for room, held in rooms.items():
            try:
                done.written.extend(write(room, held))
            except LuxError as error:
                done.failed[room] = str(error)
            bar.advance()
    if not (done.written or done.failed):
        raise InputError("there are no views to convert.")
    return done


def export_photos(crops: Sequence[LitCrop], out: Path) -> Path:
    """Photos with their cameras, as nerfstudio and as COLMAP want them.

    `images/0000.png` … (AgX(exposure · light)), `depth/0000.exr`, `transforms.json`, and
    `sparse/0/*.txt` (poses without points). Raises InputError where there are no photos.
    """
    if not crops:
        raise InputError("there are no photos to export.")
    frames = []
    with atomic_folder(Path(out)) as folder:
        for number, crop in enumerate(crops):
            name = f"images/{number:04d}.png"
            write_png(folder / name, agx(crop.image_linear * np.float32(crop.exposure)))
            depth = {"depth_m": crop.depth_m}
            write_exr(folder / "depth" / f"{number:04d}.exr", depth, half=False)
            frames.append({"file_path": name, **camera_to_nerfstudio(crop.camera)})
        write_json(folder / "transforms.json", {"camera_model": "PINHOLE", "frames": frames})
        _write_colmap(folder / "sparse" / "0", [crop.camera for crop in crops])
    return Path(out)


def _write_colmap(folder: Path, cameras: Sequence[Camera]) -> None:
    """COLMAP's text model: a PINHOLE camera and a world-to-camera pose per photo, no points."""
    folder.mkdir(parents=True)
    intrinsics, poses = [], []
    for number, camera in enumerate(cameras, start=1):
        lens = f"{camera.fx} {camera.fy} {camera.cx} {camera.cy}"
        intrinsics.append(f"{number} PINHOLE {camera.width} {camera.height} {lens}\n")
        turn = quaternion_from_matrix(camera.viewmat[:3, :3])
        pose = " ".join(repr(float(v)) for v in (*turn, *camera.viewmat[:3, 3]))
        # The empty second line stands for the photo's points.
        poses.append(f"{number} {pose} {number} {number - 1:04d}.png\n\n")
    (folder / "cameras.txt").write_text("".join(intrinsics), encoding="utf-8")
    (folder / "images.txt").write_text("".join(poses), encoding="utf-8")
    (folder / "points3D.txt").write_text("", encoding="utf-8")
