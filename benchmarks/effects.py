"""Every room of a run with and without each effect: `python -m benchmarks.effects`.

Writes OUT/effects.json, one picture a room and the page OUT.md (or OUT/effects.md inside a run's
artifacts, where the report finds it). Renders are raw panoramas of 192x96 at 32 samples on one
thread; times are CPU-seconds of Cycles. The pictures are denoised for the eye; every number comes
from the raw renders.
"""

from __future__ import annotations

import argparse
import statistics
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from benchmarks.render import Bench, effect_variants
from luxcore.errors import InputError
from luxcore.files.atomic import atomic_file, write_json
from luxcore.light.agx import agx
from luxcore.render.blender.passes import Passes
from luxcore.render.blender.scene import AMBIENT_GROUP, lamp_group
from luxcore.render.effects import Effects
from luxcore.render.oidn import Denoiser
from luxcore.rooms import Room
from luxcore.rooms.batch import read_room

SPP, HEIGHT = 32, 96
SEEDS = (1, 2)
AMPLIFIED = 8
GREY = 0.18
LABEL_PX = 14
SPLITS = ("demo", "train", "test")


@dataclass(frozen=True)
class Rendered:
    """A room rendered once."""

    seconds: float
    photo: np.ndarray
    """Raw linear light [h, w, 3]."""
    denoised: np.ndarray


@dataclass(frozen=True)
class Row:
    """One effect of one room, as decided and the other way round."""

    effect: str
    decided: str
    reason: str
    seconds: float
    seconds_other: float
    light_other: float
    """Change of the photo's light the other way round, as a share."""
    difference: float
    """Mean difference of the displayed pictures, of 255; same noise."""
    noise: float
    """Mean difference between two renders as decided that differ in noise alone, of 255."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rooms", type=Path, default=Path("artifacts/rooms"))
    parser.add_argument("--out", type=Path, default=Path("docs/effects"))
    given = parser.parse_args()
    paths = [p for split in SPLITS for p in sorted((given.rooms / split).glob("*.json"))]
    if not paths:
        raise InputError(f"{given.rooms} holds no rooms: run the stage `rooms` first.")
    found: dict[str, list[Row]] = {}
    for path in paths:
        name = f"{path.parent.name}-{path.stem}"
        found[name] = measure(read_room(path), given.out / f"{name}.jpg")
        print(name, *(f"{r.effect} {r.seconds:.2f}/{r.seconds_other:.2f}" for r in found[name]))
        # After every room: what a stopped run has measured is kept.
        write(given.out, found)


def write(out: Path, found: dict[str, list[Row]]) -> None:
    """OUT/effects.json and the page OUT.md."""
    rows = {name: [asdict(row) for row in room] for name, room in found.items()}
    about = {"spp": SPP, "size": f"{2 * HEIGHT}x{HEIGHT}"}
    write_json(out / "effects.json", {"version": 1, "about": about, "rooms": rows})
    with atomic_file(out.with_suffix(".md")) as temporary:
        temporary.write_text("\n".join(lines(found, out.name)) + "\n", encoding="utf-8")


def measure(room: Room, picture: Path) -> list[Row]:
    """All effects of a room; writes its picture, one strip an effect."""
    variants = list(effect_variants(room))
    decided = variants[0][1]
    # The usual way first and last: a drift of the machine meets both ways.
    first = rendered(room, decided, SEEDS[0])
    changed = [rendered(room, other, SEEDS[0]) for _, _, other in variants]
    last = rendered(room, decided, SEEDS[1])
    rows = [
        _row(what, decided, (first, last), found)
        for (what, _, _), found in zip(variants, changed, strict=True)
    ]
    strips = [
        _strip(f"{row.effect} ({row.decided})".replace("→", "to"), first, found)
        for row, found in zip(rows, changed, strict=True)
    ]
    with atomic_file(picture) as temporary:
        Image.fromarray(np.concatenate(strips)).save(temporary, "JPEG", quality=88)
    return rows


def rendered(room: Room, effects: Effects, seed: int) -> Rendered:
    """One render; building the scene and the first sample, which compiles it, are not counted."""
    bench = Bench(room, effects, height=HEIGHT)
    bench.render(1, 0)
    passes, seconds = bench.render(SPP, seed)
    photo = _photo(room, passes)
    return Rendered(seconds, photo, _clean(photo, passes))


def _photo(room: Room, passes: Passes) -> np.ndarray:
    total = passes.groups[AMBIENT_GROUP].astype(np.float32)
    for lamp in room.lamps:
        if lamp.on:
            total = total + np.array(lamp.scale, np.float32) * passes.groups[lamp_group(lamp.id)]
    return total


def _clean(photo: np.ndarray, passes: Passes) -> np.ndarray:
    denoiser = Denoiser(passes.guide_albedo, passes.guide_normal, quality="high", threads=1)
    clean = denoiser(photo)
    denoiser.close()
    return clean


def _row(what: str, decided: Effects, usual: tuple[Rendered, Rendered], changed: Rendered) -> Row:
    effect = getattr(decided, what.split(" ")[0] if what != "light tree" else "light_tree")
    state = ("on" if effect.on else "off") + (f", {effect.amount}" if effect.amount else "")
    first, other_seed = usual
    gain = _gain(first)
    shown, other_noise, other_way = (
        agx(gain * picture.photo) for picture in (first, other_seed, changed)
    )
    return Row(
        what,
        state,
        effect.reason,
        statistics.mean(picture.seconds for picture in usual),
        changed.seconds,
        _level(changed.photo) / _level(first.photo) - 1,
        float(255 * np.abs(shown - other_way).mean()),
        float(255 * np.abs(shown - other_noise).mean()),
    )


def _level(photo: np.ndarray) -> float:
    """Mean light without the brightest 2 %: the emitters would hide everything else."""
    return float(np.minimum(photo, np.percentile(photo, 98)).mean())


def _gain(rendered: Rendered) -> np.float32:
    return np.float32(GREY / max(float(np.median(rendered.photo.mean(axis=2))), 1e-9))


def _strip(label: str, usual: Rendered, changed: Rendered) -> np.ndarray:
    """As decided, the other way round, and the difference amplified, under a line of text."""
    gain = _gain(usual)
    first, second = agx(gain * usual.denoised), agx(gain * changed.denoised)
    difference = np.clip(AMPLIFIED * np.abs(first - second), 0, 1)
    pictures = np.concatenate([first, second, difference], axis=1)
    title = Image.new("RGB", (pictures.shape[1], LABEL_PX), "white")
    ImageDraw.Draw(title).text((3, 1), label, fill="black")
    return np.concatenate([np.asarray(title), np.round(255 * pictures).astype(np.uint8)])


def lines(found: dict[str, list[Row]], folder: str) -> Iterator[str]:
    """The page."""
    yield "# Only the effects a room calls for"
    yield ""
    yield (
        "Each room is analysed before it is rendered (`luxcore/render/effects.py`); what it does "
        "not call for is left off. Here every decision of each room below was turned "
        f"round: {2 * HEIGHT}×{HEIGHT} panoramas at {SPP} samples, CPU-seconds of Cycles on one "
        "thread (the usual way is the mean of two renders, before and after the others). *Saved* "
        "is what the decision saves: seconds the other way round minus seconds as decided; a "
        "negative number is what a wanted effect costs. *Light* is how the photo's light changes "
        "the other way round. "
        "*Picture* is the mean difference of the displayed pictures, of 255, with the same random "
        "numbers; beside it the difference that other random numbers make. The clock of a shared "
        "machine repeats to about ±10 %: smaller savings are no result."
    )
    yield ""
    yield (
        "Pictures: as decided, the other way round, their difference times "
        f"{AMPLIFIED}; denoised for the eye. Written by `python -m benchmarks.effects`."
    )
    for name, rows in found.items():
        yield from ("", f"## {name}", "")
        yield "| effect | decided | why | CPU-s | saved | light | picture | noise |"
        yield "|---" * 8 + "|"
        for row in rows:
            yield (
                f"| {row.effect} | {row.decided} | {row.reason} | {row.seconds:.2f} "
                f"| {row.seconds_other - row.seconds:+.2f} | {100 * row.light_other:+.1f} % "
                f"| {row.difference:.2f} | {row.noise:.2f} |"
            )
        yield from ("", f"![{name}: each effect both ways]({folder}/{name}.jpg)")


if __name__ == "__main__":
    main()
