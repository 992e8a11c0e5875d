"""What one light-group render saves, and what each effect costs: `python benchmarks/render.py`.

Two tables in CPU-seconds of this process (one thread; scene building is paid once and left out).
1. Light groups against the N + 2 renders that the paper's dataset took (all lamps, background, each
   lamp alone), at equal samples and, by the variance against a reference, at equal noise.
2. Effects: a room with and without each; the time, and how much of the picture changes.
"""

from __future__ import annotations

import argparse
import resource
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace
from typing import Any

import numpy as np

import benchmarks.blender_alone  # noqa: F401 (loads Blender without spinning threads)
from luxcore.render.blender.lights import OUTSIDE, only_lamp
from luxcore.render.blender.passes import Passes, configure, render
from luxcore.render.blender.scene import (
    AMBIENT_GROUP,
    build_scene,
    lamp_group,
    place_camera,
)
from luxcore.render.effects import Effect, Effects, analyse_effects
from luxcore.render.views import PanoramaView
from luxcore.rooms import Room, generate_room
from luxcore.settings.rooms import RoomsSettings

HEIGHT = 64
REFERENCE_SPP = 128
LEVEL_SPP = 64
"""Enough for the light level of a whole picture."""

GROUPS_HEAD = (
    "| room | lamps | groups, CPU-s | N + 2 renders, CPU-s | cheaper at equal samples "
    "| variance of a group / alone | cheaper at equal noise |\n" + "|---" * 7 + "|"
)
EFFECTS_HEAD = (
    "| room | effect | decided | CPU-s as decided | CPU-s the other way "
    "| light of the other way | its variance |\n" + "|---" * 7 + "|"
)


def cpu_seconds() -> float:
    """User and system time of this process."""
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


class Bench:
    """One room in Blender; renders are timed without the building of the scene."""

    def __init__(self, room: Room, effects: Effects | None = None, height: int = HEIGHT) -> None:
        self.room = room
        self.effects = effects or analyse_effects(room)
        self.scene = build_scene(room, self.effects)
        place_camera(self.scene, PanoramaView(room.viewpoints[0], 2 * height, height))

    def render(self, spp: int, seed: int, lamp: int | None = None) -> tuple[Passes, float]:
        """All groups, or one lamp (or OUTSIDE) alone; the passes and CPU-seconds."""
        lights: Any = nullcontext() if lamp is None else only_lamp(self.scene, lamp)
        with lights:
            configure(self.scene, self.effects, spp=spp, seed=seed, threads=1)
            start = cpu_seconds()
            passes = render(self.scene)
            return passes, cpu_seconds() - start


def relative_variance(image: np.ndarray, reference: np.ndarray) -> float:
    """Mean over pixels of squared error over squared reference, without the brightest 1 %."""
    error = ((image - reference) ** 2).mean(axis=2) / (reference.mean(axis=2) ** 2 + 1e-8)
    return float(np.sort(error.ravel())[: int(0.99 * error.size)].mean())


def compare_with_separate(room: Room, spp: int) -> str:
    """A row of the first table."""
    bench = Bench(room)
    bench.render(1, 0)
    reference, _ = bench.render(REFERENCE_SPP, 99)
    grouped, group_seconds = bench.render(spp, 1)
    sources = [OUTSIDE] * bool(room.openings) + list(range(len(room.lamps)))
    _, separate_seconds = bench.render(spp, 2)
    gains = []
    for number, lamp in enumerate(sources):
        name = AMBIENT_GROUP if lamp == OUTSIDE else lamp_group(lamp)
        alone, seconds = bench.render(spp, 3 + number, lamp)
        separate_seconds += seconds
        truth = reference.groups[name]
        gains.append(
            relative_variance(grouped.groups[name], truth)
            / relative_variance(alone.groups[name], truth)
        )
    faster = separate_seconds / group_seconds
    noisier = float(np.mean(gains))
    return (
        f"| {room.id} | {len(room.lamps)} | {group_seconds:.2f} | {separate_seconds:.2f} | "
        f"{faster:.1f} | {noisier:.2f} | {faster / noisier:.1f} |"
    )


def effect_variants(room: Room) -> Iterator[tuple[str, Effects, Effects]]:
    """(what, as decided, the other way round) for every decision that can be flipped."""
    decided = analyse_effects(room)
    sharp = decided.caustics.on
    yield "caustics", decided, with_effect(decided, "caustics", not sharp, decided.caustics.amount)
    on = decided.transmission.on
    yield "transmission", decided, with_effect(decided, "transmission", not on, 0 if on else 8)
    deep = decided.glossy.amount > 3
    yield "glossy bounces", decided, with_effect(decided, "glossy", True, 3 if deep else 5)
    yield "diffuse bounces 8 → 3", decided, with_effect(decided, "diffuse", True, 3)
    tree = decided.light_tree.on
    yield "light tree", decided, with_effect(decided, "light_tree", not tree, 0)
    if decided.environment.on:
        yield "portals", decided, with_effect(decided, "portals", False, 0)
        yield "environment", decided, with_effect(decided, "environment", False, 0)


def effect_row(room: Room, what: str, decided: Effects, other: Effects, spp: int) -> str:
    """A row of the second table: time either way, and the change of the photo's light."""
    pictures, noises, seconds = [], [], []
    for effects in (decided, other):
        bench = Bench(room, effects)
        bench.render(1, 0)
        truth, _ = bench.render(LEVEL_SPP, 7)
        passes, took = bench.render(spp, 1)
        pictures.append(photo(room, truth))
        noises.append(relative_variance(photo(room, passes), photo(room, truth)))
        seconds.append(took)
    level = pictures[0].mean()
    lost = 100 * float(pictures[1].mean() / level - 1)
    field = what.split(" ")[0] if what.split(" ")[0] != "light" else "light_tree"
    state = "on" if getattr(decided, field).on else "off"
    return (
        f"| {room.id} | {what} | {state} | {seconds[0]:.2f} | {seconds[1]:.2f} | "
        f"{lost:+.1f} % | {noises[1] / noises[0]:.2f} |"
    )


def photo(room: Room, passes: Passes) -> np.ndarray:
    """[h, w, 3] linear radiance with all lamps at their own power."""
    total = passes.groups[AMBIENT_GROUP].astype(np.float64)
    for lamp in room.lamps:
        total = total + np.array(lamp.scale) * passes.groups[lamp_group(lamp.id)]
    # Without the emitters themselves, which would hide everything else.
    return np.minimum(total, np.percentile(total, 98))


def with_effect(effects: Effects, field: str, on: bool, amount: int) -> Effects:
    """The same decisions but for one."""
    return replace(effects, **{field: Effect(on, "benchmark", amount)})


def main() -> None:
    """Print both tables as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--seeds", type=int, nargs="+", default=[5, 7, 3])
    parser.add_argument("--effects", action="store_true", help="the second table too")
    arguments = parser.parse_args()
    rooms = [generate_room(seed, RoomsSettings()) for seed in arguments.seeds]
    rows = [GROUPS_HEAD]
    rows += [compare_with_separate(room, arguments.spp) for room in rooms]
    if arguments.effects:
        rows += ["", EFFECTS_HEAD]
        for room in rooms:
            rows += [effect_row(room, *variant, arguments.spp) for variant in effect_variants(room)]
    print("\n".join(rows), file=sys.stderr)


if __name__ == "__main__":
    main()
