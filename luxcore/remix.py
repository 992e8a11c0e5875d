"""Photos of a room to a relightable scene: the inference half of the pipeline, in one folder.

The same library functions as the stages of the flow, in the same order. Every step is a unit keyed
by its inputs, so that a second call, or one after a kill, continues where the first ended.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from luxcore.capture import Capture, ingest, load_capture, placed_sentence
from luxcore.decompose.stage import decompose_capture
from luxcore.errors import InputError
from luxcore.files.atomic import write_json
from luxcore.files.digests import tree_digest
from luxcore.harmonize.stage import CODE as HARMONIZE_CODE
from luxcore.harmonize.stage import harmonize_capture
from luxcore.light.fuse import fuse_capture
from luxcore.masks import find_lamps
from luxcore.settings.base import Settings
from luxcore.settings.project import ProjectSettings
from luxcore.splats.stage1 import fit_geometry
from luxcore.splats.stage2 import fit_lights
from luxcore.units import UnitStore, unit_key

Log = Callable[[str], None]

_MARK = "work/remix.json"
"""What tells an earlier result, whole or cut short, from a folder of the user's own."""

_CODE = (*HARMONIZE_CODE, "luxcore/splats", "luxcore/metrics", "kernels")
"""All that any step runs. One list, since every step reads through most of it."""


@dataclass(frozen=True)
class _Work:
    """Where one remix keeps its steps, and how each is keyed."""

    store: UnitStore
    settings: ProjectSettings
    name: str

    def step(self, stage: str, inputs: list[Path], compute: Callable[[Path], object]) -> Path:
        """The unit of `stage`, a folder named after the capture; computed where missing."""
        section: Settings = getattr(self.settings, stage)
        arguments = {"stage": stage, "seed": self.settings.seed, "name": self.name}
        arguments["settings"] = section.model_dump(mode="json")
        digests = [tree_digest([folder], folder) for folder in inputs]
        key = unit_key(_CODE, arguments, digests)
        folder = self.store.get(key)
        if folder is None:
            folder = self.store.put(key, lambda out: _into(out / self.name, compute))
        return folder / self.name

    def checkpoint(self, stage: str) -> Path:
        """Where a long fit keeps what a kill must not cost."""
        return self.store.root / "checkpoints" / stage


def remix(source: Path, out: Path, settings: ProjectSettings, log: Log = print) -> Path:
    """Turn the photos in `source` into the scene `out`; returns `out`.

    The steps' folders stay in `out/work`. Raises InputError for what cannot be used and LuxError
    where too few views can be placed or no lamp is found; then nothing is left behind.
    """
    source, out = Path(source), Path(out)
    _check_out(source, out)
    existed = out.exists()
    work = _Work(UnitStore(out / "work"), settings, _name(source))
    try:
        write_json(out / _MARK, {"capture": work.name})
        scene = _run(source, work, log)
    except BaseException:
        if not any((out / "work").glob("*/*/manifest.json")):
            shutil.rmtree(out / "work" if existed else out, ignore_errors=True)
        raise
    _publish(scene, out)
    log(f"scene: {out}")
    return out


def _check_out(source: Path, out: Path) -> None:
    """Raises InputError where `out` holds something else, or would change what `source` holds."""
    if not source.is_dir():
        raise InputError(f"{source} is not a folder.")
    if out.exists() and not (out.is_dir() and (not any(out.iterdir()) or (out / _MARK).is_file())):
        raise InputError(f"{out} exists and is not an earlier result of this command.")
    if out.resolve().is_relative_to(source.resolve()):
        raise InputError(f"{out} lies in {source}, the photos' folder; name one outside of it.")


def _run(source: Path, work: _Work, log: Log) -> Path:
    settings, seed = work.settings, work.settings.seed
    captured = work.step("capture", [source], lambda o: ingest(source, o, settings.capture, seed))
    capture = load_capture(captured)
    log(placed_sentence(capture))
    masks = work.step("masks", [captured], lambda o: find_lamps(capture, o, settings.masks))
    splat = work.step("splat", [captured], lambda o: _geometry(capture, o, work, log))
    decomposed = work.step(
        "decompose",
        [captured, masks, splat, *_local(settings.decompose.weights)],
        lambda o: decompose_capture(captured, masks, splat, o, settings.decompose, seed=seed),
    )
    harmonized = work.step(
        "harmonize",
        [captured, masks, splat, decomposed, *_local(settings.harmonize.weights)],
        lambda o: harmonize_capture(
            captured, masks, splat, decomposed, o, settings.harmonize, work.store, seed=seed
        ),
    )
    fused = work.step(
        "fuse",
        [captured, harmonized],
        lambda o: fuse_capture(harmonized, capture, o, settings.fuse, work.store),
    )
    return work.step(
        "relight",
        [captured, masks, splat, fused],
        lambda o: fit_lights(
            capture,
            splat,
            fused,
            masks,
            o,
            settings.relight,
            seed=seed,
            checkpoint=work.checkpoint("relight"),
            log=log,
        ),
    )


def _local(weights: str | None) -> list[Path]:
    """Weights that lie here: other bytes under the same name make a step stale."""
    return [Path(weights)] if weights and Path(weights).exists() else []


def _geometry(capture: Capture, out: Path, work: _Work, log: Log) -> None:
    fit_geometry(
        capture,
        out,
        work.settings.splat,
        seed=work.settings.seed,
        checkpoint=work.checkpoint("splat"),
        log=log,
    )


def _into(folder: Path, compute: Callable[[Path], object]) -> None:
    folder.mkdir()
    compute(folder)


def _publish(scene: Path, out: Path) -> None:
    """Copy the scene's files beside `work`, its description last: without it there is no scene."""
    for item in sorted(scene.iterdir(), key=lambda path: path.name == "scene.json"):
        if item.is_dir():
            shutil.copytree(item, out / item.name, dirs_exist_ok=True)
        else:
            shutil.copy2(item, out / item.name)


def _name(source: Path) -> str:
    """A capture id from the folder's name: letters, digits, `_` and `-` only."""
    kept = "".join(c if c.isascii() and c.isalnum() else "_" for c in source.resolve().name.lower())
    return kept[:64].strip("_") or "capture"
