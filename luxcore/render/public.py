"""Rooms to the public dataset layout: one scene folder a room, and a page about all of them."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from luxcore.data.compact import load_rendered
from luxcore.data.public_writer import check_ours, shard_members, write_scene, write_shards
from luxcore.errors import InputError, LuxError
from luxcore.files.atomic import write_json
from luxcore.files.output import check_out_folder
from luxcore.render.dataset import Job, check_disk, panorama_jobs, run_jobs
from luxcore.rooms.model import Room
from luxcore.settings.render import RenderSettings
from luxcore.statistics.contact_sheet import contact_sheet, save_sheet
from luxcore.statistics.dataset import PAGE, SHEET
from luxcore.statistics.facts import ViewFacts, facts_of_files
from luxcore.statistics.page import write_page
from luxcore.units import Executor, UnitStore, read_seconds

LAST_SCENE_ID = 999_999


@dataclass(frozen=True)
class PublicRender:
    """What was written, and which views failed with which cause."""

    scenes: tuple[Path, ...]
    views: int
    failed: dict[str, str]


def render_public(
    rooms: Sequence[Room],
    out: Path,
    settings: RenderSettings,
    executor: Executor,
    *,
    shard_split: str | None = None,
) -> PublicRender:
    """Render rooms into `out`/<six digits of the room's seed>/.

    A view that fails leaves its room with fewer views; a room without views is left out; both are
    named in the result. Work is kept in `out`/work until all is written, so a killed call resumes.
    With `shard_split` ("training", "test") the scenes are packed into tars of ten.
    Raises InputError for seeds without a six-digit id and for scenes, shards or a folder `work` in
    `out` that are not ours, and LuxError when the disk is too small.
    """
    work = out / "work"
    _check(rooms, out, work, shard_split)
    jobs = {room.id: panorama_jobs([room], settings, room.id) for room in rooms}
    flat = [job for each in jobs.values() for job in each]
    # What the public layout takes comes on top of the units; it is of the same order.
    check_disk(flat + flat, out)
    failed = run_jobs(flat, work / "views", settings, UnitStore(work / "units"), executor)
    seconds = read_seconds(UnitStore(work / "units"))
    shown = {}
    for room in rooms:
        done = [job for job in jobs[room.id] if job.unit.name not in failed]
        if done:
            shown[room.id] = _write_room(room, done, seconds, work, out)
    if not shown:
        raise LuxError(f"no view of {len(rooms)} rooms could be rendered: {_first(failed)}")
    _write_pages(out, shown, shard_split)
    scenes = [out / scene_id for scene_id in shown]
    if shard_split is not None:
        write_shards(scenes, out, shard_split)
        for scene in scenes:
            shutil.rmtree(scene)
    shutil.rmtree(work)
    return PublicRender(tuple(scenes), sum(len(s.stems) for s in shown.values()), failed)


def _check(rooms: Sequence[Room], out: Path, work: Path, shard_split: str | None) -> None:
    """Everything that would be replaced, before any rendering."""
    for room in rooms:
        if not 0 <= room.seed <= LAST_SCENE_ID:
            raise InputError(f"{room.seed} is no six-digit scene id: use 0 to {LAST_SCENE_ID}.")
        check_ours(out / room.id)
    check_out_folder(work, ("units", "views"))
    if shard_split is not None:
        for name in shard_members([room.id for room in rooms], shard_split):
            check_ours(out / f"{name}.tar")


@dataclass(frozen=True)
class Shown:
    """The finished views of one room, and what their files say."""

    stems: list[Path]
    facts: list[ViewFacts]


def _write_room(
    room: Room, done: list[Job], seconds: dict[str, dict[str, float]], work: Path, out: Path
) -> Shown:
    stems = [work / "views" / job.stem for job in done]
    write_scene(out, room.id, [load_rendered(stem) for stem in stems], seed=room.seed)
    names = [job.unit.name for job in done]
    pairs = zip(stems, names, strict=True)
    return Shown(stems, [facts_of_files(stem, name, seconds.get(name)) for stem, name in pairs])


def _write_pages(out: Path, shown: dict[str, Shown], shard_split: str | None) -> None:
    """statistics.html about everything, one page a shard, one JSON a room."""
    for room, views in shown.items():
        facts = [asdict(fact) for fact in views.facts]
        write_json(out / "statistics" / f"{room}.json", {"views": facts})
    sheet = _write_page(out / PAGE, out.resolve().name, shown)
    save_sheet(out / SHEET, sheet)
    if shard_split is not None:
        for name, members in shard_members(list(shown), shard_split).items():
            _write_page(out / f"{name}.html", name, {i: shown[i] for i in members})


def _write_page(path: Path, title: str, shown: dict[str, Shown]) -> np.ndarray:
    sheet = contact_sheet([stem for views in shown.values() for stem in views.stems])
    write_page(path, title, [fact for views in shown.values() for fact in views.facts], sheet)
    return sheet


def _first(failed: dict[str, str]) -> str:
    return next((f"{name}: {cause}" for name, cause in sorted(failed.items())), "no viewpoint.")
