"""The rooms of a dataset: training, held-out, and the demo room, by seed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

from luxcore.errors import FormatError, InputError
from luxcore.files.atomic import write_json
from luxcore.rooms.generate import generate_room
from luxcore.rooms.model import Room
from luxcore.settings.rooms import TEST_SEED_BASE, RoomsSettings

SPLITS = ("train", "test", "demo")


def room_seeds(settings: RoomsSettings) -> dict[str, list[int]]:
    """Seeds by split; the ranges are disjoint whatever the settings.

    Raises InputError when the training seeds would reach into the held-out range.
    """
    last = settings.first_seed + settings.train
    if last > TEST_SEED_BASE:
        raise InputError(
            f"rooms.train={settings.train} from seed {settings.first_seed} reaches the held-out "
            f"seeds, which begin at {TEST_SEED_BASE}."
        )
    return {
        "train": list(range(settings.first_seed, last)),
        "test": list(range(TEST_SEED_BASE, TEST_SEED_BASE + settings.test)),
        "demo": [settings.demo_seed],
    }


def demo_room(settings: RoomsSettings) -> Room:
    """The room of the demo capture: its lamps are all on."""
    few = settings.model_copy(update={"max_lamps": settings.demo_lamps, "off_probability": 0.0})
    return generate_room(settings.demo_seed, few)


def write_rooms(folder: Path, settings: RoomsSettings) -> dict[str, int]:
    """`train/0000.json`, …, `test/0000.json`, …, `demo/demo.json`; returns the counts."""
    seeds = room_seeds(settings)
    for split in ("train", "test"):
        for number, seed in enumerate(seeds[split]):
            room = generate_room(seed, settings)
            write_json(folder / split / f"{number:04d}.json", room.to_json())
    write_json(folder / "demo" / "demo.json", demo_room(settings).to_json())
    return {split: len(seeds[split]) for split in SPLITS}


def read_rooms(folder: Path) -> Iterator[Room]:
    """The rooms of one split, in order. Raises FormatError naming the file."""
    for path in sorted(folder.glob("*.json")):
        yield read_room(path)


def read_room(path: Path) -> Room:
    """One room. Raises FormatError naming the file and the fact."""
    try:
        return Room.from_json(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, AttributeError) as error:
        raise FormatError(f"{path} is not a room: {error}.") from error
    except FormatError as error:
        raise FormatError(f"{path}: {error}") from error
