"""Run the units that a store lacks, keep the rest, name and set aside those that fail."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from luxcore.errors import InputError, LuxError
from luxcore.progress import progress
from luxcore.units.executor import Executor, SerialExecutor
from luxcore.units.guard import Limits, run_guarded, sentence
from luxcore.units.store import UnitStore

SECONDS = "seconds.jsonl"
"""Beside the units, never inside of one: equal units have equal bytes, not equal times."""


@dataclass(frozen=True)
class Unit:
    """One keyed piece of work: `function` "module:name" is called as `f(out_dir, **arguments)`.

    What it returns is None or CPU seconds by step, which are kept apart from its files.
    """

    name: str
    function: str
    arguments: dict[str, Any]
    key: str


@dataclass(frozen=True)
class Ended:
    """How a unit ended: why it failed, or None; what it cost, where its function says so."""

    problem: str | None
    seconds: dict[str, float] | None = None
    disk_is_short: bool = False
    """It was not begun: the failure is not the unit's."""


@dataclass
class UnitsResult:
    """Folders of finished units by name, reasons of failed ones, how many were found done."""

    folders: dict[str, Path] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    reused: int = 0


def run_units(
    units: Sequence[Unit],
    store: UnitStore,
    executor: Executor | None = None,
    *,
    label: str = "units",
    max_failed_ratio: float = 0.0,
    limits: Limits | None = None,
    spare_bytes: int = 0,
) -> UnitsResult:
    """Compute what `store` lacks.

    No unit is begun where the store's disk has less than `spare_bytes` free. Raises LuxError when
    that happens, and naming the failures when they are more than `max_failed_ratio` of all.
    """
    result, missing = _split(units, store)
    rows = [(str(store.root), u.key, u.function, u.arguments, limits, spare_bytes) for u in missing]
    short = 0
    with progress(label, len(missing), "units", quiet=not missing) as bar:
        for index, outcome in (executor or SerialExecutor()).run(_compute, rows):
            # A worker that died gives an exception instead.
            ended = outcome if isinstance(outcome, Ended) else Ended(sentence(outcome))
            if ended.disk_is_short:
                short += 1
                continue
            _record(result, store, missing[index], ended)
            bar.advance(failed=len(result.failed), reused=result.reused)
    for unit in missing:
        store.clear_leftovers(unit.key)
    if result.failed:
        _quarantine(store, result.failed)
    if short:
        raise LuxError(
            f"{store.root} has less than {spare_bytes / 1e6:.0f} MB free: stopped before "
            f"{short} of {len(units)} {label}; make room and start again, what is done is kept."
        )
    if len(result.failed) > max_failed_ratio * len(units):
        name, reason = next(iter(sorted(result.failed.items())))
        raise LuxError(f"{len(result.failed)} of {len(units)} {label} failed: {name}: {reason}")
    return result


def missing_units(units: Sequence[Unit], store: UnitStore) -> list[Unit]:
    """The units that a run would compute."""
    return [u for u in units if not store.has(u.key)]


def read_seconds(store: UnitStore) -> dict[str, dict[str, float]]:
    """CPU seconds by step of the units that were computed here, by name; the latest counts."""
    path = store.root / SECONDS
    seconds = {}
    for line in path.read_text().splitlines() if path.is_file() else ():
        # A run that was killed may leave half a line.
        with suppress(ValueError):
            entry = json.loads(line)
            seconds[entry["unit"]] = entry["seconds"]
    return seconds


def _split(units: Sequence[Unit], store: UnitStore) -> tuple[UnitsResult, list[Unit]]:
    if len({u.name for u in units}) != len(units):
        raise InputError("two units have the same name.")
    result, missing = UnitsResult(), []
    for unit in units:
        folder = store.get(unit.key)
        if folder is None:
            missing.append(unit)
        else:
            result.folders[unit.name] = folder
            result.reused += 1
    return result, missing


def _record(result: UnitsResult, store: UnitStore, unit: Unit, ended: Ended) -> None:
    if ended.problem is not None:
        result.failed[unit.name] = ended.problem
        return
    result.folders[unit.name] = store.path(unit.key)
    if ended.seconds is not None:
        line = {"unit": unit.name, "key": unit.key, "seconds": ended.seconds}
        with open(store.root / SECONDS, "a", encoding="utf-8") as stream:
            stream.write(json.dumps(line, sort_keys=True) + "\n")


def _compute(
    root: str,
    key: str,
    function: str,
    arguments: dict[str, Any],
    limits: Limits | None,
    spare_bytes: int,
) -> Ended:
    """Run one unit in whatever process this is; a reason comes back instead of an exception."""
    Path(root).mkdir(parents=True, exist_ok=True)
    if shutil.disk_usage(root).free < spare_bytes:
        return Ended("the disk is short", disk_is_short=True)
    returned: list[Any] = []

    def write(out: Path) -> None:
        returned.append(run_guarded(function, out, arguments, limits))

    try:
        UnitStore(Path(root)).put(key, write)
    except Exception as error:
        return Ended(sentence(error))
    return Ended(None, returned[0])


def _quarantine(store: UnitStore, failed: dict[str, str]) -> None:
    store.root.mkdir(parents=True, exist_ok=True)
    with open(store.root / "quarantine.jsonl", "a", encoding="utf-8") as stream:
        for name, reason in sorted(failed.items()):
            stream.write(json.dumps({"unit": name, "reason": reason}) + "\n")
