"""Between our compact form and the public layout, both ways, and photos out to other tools."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from luxcore.cameras import Camera, camera_to_nerfstudio
from luxcore.data.compact import holds_compact, list_rendered, save_rendered
from luxcore.data.crops import LitCrop
from luxcore.data.multiview import MultiViewSets
from luxcore.data.public_reader import open_scenes, public_views
from luxcore.data.public_writer import AS_TAKEN_PASS, write_scene
from luxcore.data.rotations import quaternion_from_matrix
from luxcore.data.store import AnyView, by_room, load_view
from luxcore.errors import InputError
from luxcore.files.atomic import atomic_folder, write_json
from luxcore.files.exr import write_exr
from luxcore.files.photos import write_png
from luxcore.light.agx import agx
from luxcore.progress import progress


def compact_to_public(
    stems: Sequence[Path], root: Path, *, first_scene: int = 0, seed: int = 0
) -> list[Path]:
    """One public scene per room, numbered from `first_scene` in the order of `stems`."""
    rooms = by_room(stems)
    scenes = []
    with progress("public layout", len(rooms), "scenes") as bar:
        for number, members in enumerate(rooms.values(), start=first_scene):
            views = [load_view(stem) for stem in members]
            scenes.append(write_scene(root, f"{number:06d}", views, seed=seed))
            bar.advance()
    return scenes


def public_to_compact(path: Path, out: Path) -> list[Path]:
    """Every view of the scenes at `path` (shards or folders) as `out`/SSSSSS_V; returns the stems.

    The photo is the mix "as taken" where the scene has it, else the full mix.
    """
    stems = []
    for scene in open_scenes(path):
        mix = AS_TAKEN_PASS if AS_TAKEN_PASS in scene.mix_passes else 0
        for view in scene.views:
            stems.append(Path(out) / f"{scene.scene_id}_{view}")
            save_rendered(scene.read_view(view, mix), stems[-1])
    return stems


def cut_photos(
    source: Path, out: Path, *, photos: int, size: tuple[int, int], seed: int = 0
) -> list[Path]:
    """`photos` overlapping perspective photos of every room of `source` as `out`/ROOM.

    `source`: views in either form; `size` is (height, width). See `export_photos`.
    """
    views: Sequence[AnyView] = (
        list_rendered(source) if holds_compact(source) else public_views(source)
    )
    rooms = by_room(views)
    folders = []
    with progress("photos", len(rooms), "rooms") as bar:
        for room, members in rooms.items():
            sets = MultiViewSets(members, size, seed, relit=False, mask_kinds=("fixture",))
            folders.append(export_photos(sets.crops(0, photos), Path(out) / room))
            bar.advance()
    return folders


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
