"""Rooms to a folder of rendered views: units, numbering, and what went wrong where."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from luxcore.data.compact import list_rendered, read_metadata
from luxcore.errors import LuxError
from luxcore.files.atomic import write_json
from luxcore.render.paths import walk
from luxcore.render.unit import NOT_IN_THE_PIXELS, RENDER_CODE, view_job
from luxcore.render.views import PanoramaView
from luxcore.rooms.batch import read_room, read_rooms
from luxcore.rooms.model import Room
from luxcore.settings.render import RenderSettings
from luxcore.units import Executor, Unit, UnitStore, run_units, unit_key

BYTES_PER_PIXEL_AND_LIGHT = 5.0
"""All files of a view take 2.8 to 3.5 bytes a pixel for each lamp and 3 more; noise packs worse."""

SPARE_BYTES = 256 << 20
"""Disk that a render leaves free for everything else."""


@dataclass(frozen=True)
class Job:
    """One view to render: the unit and the place of its files."""

    unit: Unit
    stem: str
    pixels: int
    lights: int


def panorama_jobs(rooms: list[Room], settings: RenderSettings, split: str) -> list[Job]:
    """`views_per_room` panoramas of each room (fewer where fewer fit), numbered in order."""
    jobs: list[Job] = []
    size = (2 * settings.height, settings.height)
    for room in rooms:
        for number, point in enumerate(room.viewpoints[: settings.views_per_room]):
            view = PanoramaView(point, *size)
            arguments = view_job(room, view, settings, name="view", spp=settings.spp, number=number)
            jobs.append(_job(room, arguments, f"{split}/{len(jobs):06d}", size))
    return jobs


def demo_jobs(room: Room, settings: RenderSettings) -> list[Job]:
    """Perspective views along a walk, for a capture with known truth."""
    size = (settings.demo_width, settings.demo_height)
    cameras = walk(room, settings.demo_views, settings.demo_fov_deg, *size)
    jobs = []
    for number, camera in enumerate(cameras):
        arguments = view_job(
            room, camera, settings, name="view", spp=settings.demo_spp, number=number
        )
        jobs.append(_job(room, arguments, f"demo/views/{number:04d}", size))
    return jobs


def render_dataset(
    rooms_dir: Path, out: Path, settings: RenderSettings, store: UnitStore, executor: Executor
) -> dict[str, float]:
    """Render `rooms_dir`/train, /test and /demo into `out`; returns counts.

    Raises LuxError before anything is rendered when the disk is too small, and when more views
    fail than `settings.max_failed_ratio` allows.
    """
    demo = read_room(rooms_dir / "demo" / "demo.json")
    jobs = demo_jobs(demo, settings)
    for split in ("train", "test"):
        jobs += panorama_jobs(list(read_rooms(rooms_dir / split)), settings, split)
    failed = run_jobs(jobs, out, settings, store, executor)
    write_json(out / "demo" / "room.json", demo.to_json())
    return {
        "views": float(len(jobs) - len(failed)),
        "failed": float(len(failed)),
        **dataset_statistics(out),
    }


def run_jobs(
    jobs: list[Job], out: Path, settings: RenderSettings, store: UnitStore, executor: Executor
) -> dict[str, str]:
    """Run what the store lacks and copy all views to their places; returns {view: cause}."""
    missing = [job for job in jobs if not store.has(job.unit.key)]
    check_disk(missing, store.root, out)
    result = run_units(
        [job.unit for job in jobs],
        store,
        executor,
        label="views",
        max_failed_ratio=settings.max_failed_ratio,
        spare_bytes=SPARE_BYTES,
    )
    for job in jobs:
        if job.unit.name in result.folders:
            _copy_view(result.folders[job.unit.name], out / job.stem)
    return dict(result.failed)


def estimated_bytes(jobs: list[Job]) -> int:
    """Disk that the views will take: the unit and its copy."""
    return int(sum(2 * j.pixels * BYTES_PER_PIXEL_AND_LIGHT * (j.lights + 2) for j in jobs))


def check_disk(jobs: list[Job], *folders: Path) -> None:
    """Raises LuxError naming the folder when it has less room than the views need."""
    needed = estimated_bytes(jobs)
    for folder in folders:
        existing = next(p for p in (folder.absolute(), *folder.absolute().parents) if p.is_dir())
        free = shutil.disk_usage(existing).free - SPARE_BYTES
        if jobs and free < needed:
            raise LuxError(
                f"{folder} has {max(free, 0) / 1e9:.2f} GB to spare, "
                f"{len(jobs)} views need about {needed / 1e9:.2f} GB."
            )


def dataset_statistics(out: Path) -> dict[str, float]:
    """Lamps a view, the share of them that is on, and clipped values, over all views."""
    abouts = [read_metadata(stem) for stem in list_rendered(out)]
    lamps = [lamp for about in abouts for lamp in about["lamps"]]
    return {
        "lamps_per_view": len(lamps) / max(1, len(abouts)),
        "lamps_on": float(np.mean([lamp["on"] for lamp in lamps])) if lamps else 0.0,
        "clipped_values": float(sum(about.get("clipped_values", 0) for about in abouts)),
    }


def _job(room: Room, arguments: dict[str, Any], stem: str, size: tuple[int, int]) -> Job:
    keyed = {k: v for k, v in arguments.items() if k not in NOT_IN_THE_PIXELS}
    key = unit_key(RENDER_CODE, keyed)
    unit = Unit(stem, "luxcore.render.unit:render_unit", arguments, key)
    return Job(unit, stem, size[0] * size[1], len(room.lamps) + 1)


def _copy_view(folder: Path, stem: Path) -> None:
    """`view.exr`, `view.json`, … of a unit to `<stem>.exr`, …"""
    stem.parent.mkdir(parents=True, exist_ok=True)
    found = sorted(folder.glob("view.*"))
    if not found:
        raise LuxError(f"{folder} holds no rendered view.")
    for file in found:
        shutil.copyfile(file, stem.with_name(stem.name + file.name.removeprefix("view")))
