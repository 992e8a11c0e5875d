"""The rooms that the shipped weights see: `python -m luxcore.models.small.rooms --out DIR`.

Training rooms and held-out rooms as compact panoramas, and `manifest.json` with the seed and the
digest of every panorama. A killed call goes on where it stopped; LUX_EXECUTOR and LUX_WORKERS
choose where the work runs.
"""

from __future__ import annotations

import sys
from dataclasses import asdict, dataclass
from pathlib import Path

import click

from luxcore.errors import LuxError
from luxcore.files.atomic import write_json
from luxcore.files.digests import array_digest, value_digest
from luxcore.files.exr import read_exr
from luxcore.render.dataset import Job, panorama_jobs, run_jobs
from luxcore.rooms.generate import generate_room
from luxcore.settings.render import RenderSettings
from luxcore.settings.rooms import TEST_SEED_BASE, RoomsSettings
from luxcore.units import UnitStore, executor_from_environment

FIRST_TRAIN_SEED = 1_000
"""Clear of the seeds that examples and tests use."""

SLICE = 20
"""Rooms whose panoramas are rendered and then copied to their places together."""


@dataclass(frozen=True)
class Listed:
    """One panorama in the manifest; `pixels` is a sha256 over all of its layers."""

    name: str
    split: str
    seed: int
    view: int
    pixels: str


def render_rooms(
    seeds: range, split: str, settings: RenderSettings, out: Path, store: UnitStore
) -> list[Listed]:
    """Render `settings.views_per_room` panoramas of each room into `out`/`split`.

    A panorama that fails is left out, and so is missing in the list.
    """
    rooms = [generate_room(seed, RoomsSettings()) for seed in seeds]
    jobs = panorama_jobs(rooms, settings, split)
    step = SLICE * settings.views_per_room
    failed: dict[str, str] = {}
    for start in range(0, len(jobs), step):
        part = jobs[start : start + step]
        failed |= run_jobs(part, out, settings, store, executor_from_environment())
    for name, cause in sorted(failed.items()):
        click.echo(f"left out {name}: {cause}", err=True)
    return [_listed(job, split, out) for job in jobs if job.unit.name not in failed]


def _listed(job: Job, split: str, out: Path) -> Listed:
    room = job.unit.arguments["room"]
    number = job.unit.arguments["seed"] - room["seed"] * 1009
    return Listed(Path(job.stem).name, split, room["seed"], number, _pixels(out / job.stem))


def _pixels(stem: Path) -> str:
    files = [stem.with_name(stem.name + f) for f in (".exr", ".geometry.exr", ".masks.exr")]
    layers = [read_exr(file) for file in files]
    return value_digest([[n, array_digest(v)] for each in layers for n, v in sorted(each.items())])


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--train", default=400, show_default=True, help="Training rooms.")
@click.option("--first-seed", default=FIRST_TRAIN_SEED, show_default=True,
              type=click.IntRange(0, TEST_SEED_BASE - 1),
              help="Seed of the first training room.")  # fmt: skip
@click.option("--test", default=30, show_default=True, help="Held-out rooms.")
@click.option("--views", default=2, show_default=True, type=click.IntRange(1, 4),
              help="Panoramas a room; fewer where fewer fit.")  # fmt: skip
@click.option("--height", default=256, show_default=True, help="Rows of a panorama.")
@click.option("--spp", default=4, show_default=True, help="Samples per pixel, training rooms.")
@click.option("--test-spp", default=8, show_default=True, help="Samples per pixel, held-out rooms.")
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Folder to write.")
def main(
    train: int,
    first_seed: int,
    test: int,
    views: int,
    height: int,
    spp: int,
    test_spp: int,
    out: Path,
) -> None:
    """Render the rooms for training and testing the small models, and list their digests."""
    shared = {"height": height, "views_per_room": views, "max_failed_ratio": 1.0}
    splits = {
        "test": (range(TEST_SEED_BASE, TEST_SEED_BASE + test), test_spp),
        "train": (range(first_seed, first_seed + train), spp),
    }
    store, listed = UnitStore(out / "units"), []
    try:
        for split, (seeds, samples) in splits.items():
            settings = RenderSettings(**shared, spp=samples)
            listed += render_rooms(seeds, split, settings, out, store)
    except LuxError as error:
        click.echo(f"lux: {error}", err=True)
        sys.exit(error.exit_code)
    command = f"--train {train} --first-seed {first_seed} --test {test} --views {views}"
    command += f" --height {height} --spp {spp}"
    about = {"command": f"python -m luxcore.models.small.rooms {command} --test-spp {test_spp}"}
    write_json(out / "manifest.json", {**about, "panoramas": [asdict(entry) for entry in listed]})
    click.echo(f"{len(listed)} panoramas in {out}")


if __name__ == "__main__":
    main()
