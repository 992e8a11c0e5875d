"""Rooms to the public dataset layout: one scene folder a room, a contact sheet, statistics."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from luxcore.data.compact import RenderedView, load_rendered
from luxcore.data.public_writer import write_scene, write_shards
from luxcore.errors import InputError, LuxError
from luxcore.files.atomic import write_json
from luxcore.render.contact_sheet import write_contact_sheet
from luxcore.render.dataset import check_disk, panorama_jobs, run_jobs
from luxcore.render.statistics import view_statistics
from luxcore.rooms.generate import generate_room
from luxcore.rooms.model import Room
from luxcore.settings.render import RenderSettings
from luxcore.settings.rooms import RoomsSettings
from luxcore.units import Executor, UnitStore

LAST_SCENE_ID = 999_999


@dataclass(frozen=True)
class PublicRender:
    """What was written, and which views failed with which cause."""

    scenes: tuple[Path, ...]
    views: int
    failed: dict[str, str]


def render_public(
    seeds: Iterable[int],
    out: Path,
    settings: RenderSettings,
    rooms_settings: RoomsSettings,
    executor: Executor,
    *,
    shard_split: str | None = None,
) -> PublicRender:
    """Render the rooms of `seeds` into `out`/<six digits of the seed>/.

    A view that fails leaves its room with fewer views; a room without views is left out; both are
    named in the result. Work is kept in `out`/work until all is written, so a killed call resumes.
    With `shard_split` ("training", "test") the scenes are packed into tars of ten.
    Raises InputError for seeds without a six-digit id and LuxError when the disk is too small.
    """
    rooms = [_room(seed, rooms_settings) for seed in seeds]
    work = out / "work"
    jobs = {room.id: panorama_jobs([room], settings, room.id) for room in rooms}
    flat = [job for each in jobs.values() for job in each]
    # What the public layout takes comes on top of the units; it is of the same order.
    check_disk(flat + flat, out)
    failed = run_jobs(flat, work / "views", settings, UnitStore(work / "units"), executor)
    scenes, views = [], 0
    for room in rooms:
        stems = [work / "views" / j.stem for j in jobs[room.id] if j.unit.name not in failed]
        if stems:
            loaded = [load_rendered(stem) for stem in stems]
            scenes.append(write_scene(out, room.id, loaded, seed=room.seed))
            views += len(loaded)
            _write_statistics(out / "statistics" / f"{room.id}.json", loaded)
    if not scenes:
        raise LuxError(f"no view of {len(rooms)} rooms could be rendered: {_first(failed)}")
    write_contact_sheet(work / "views", out / "contact_sheet.png")
    if shard_split is not None:
        write_shards(scenes, out, shard_split)
        for scene in scenes:
            shutil.rmtree(scene)
    shutil.rmtree(work)
    return PublicRender(tuple(scenes), views, failed)


def _room(seed: int, settings: RoomsSettings) -> Room:
    if not 0 <= seed <= LAST_SCENE_ID:
        raise InputError(f"seed {seed} has no six-digit scene id: use 0 to {LAST_SCENE_ID}.")
    return generate_room(seed, settings)


def _write_statistics(path: Path, views: list[RenderedView]) -> None:
    write_json(path, {"views": [view_statistics(view) for view in views]})


def _first(failed: dict[str, str]) -> str:
    return next((f"{name}: {cause}" for name, cause in sorted(failed.items())), "no viewpoint.")
