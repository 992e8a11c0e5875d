"""Run the units that a store lacks, keep the rest, name and set aside those that fail."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from luxcore.errors import InputError, LuxError
from luxcore.progress import progress
from luxcore.units.executor import Executor, SerialExecutor
from luxcore.units.guard import Limits, run_guarded
from luxcore.units.store import UnitStore


@dataclass(frozen=True)
class Unit:
    """One keyed piece of work: `function` "module:name" is called as `f(out_dir, **arguments)`."""

    name: str
    function: str
    arguments: dict[str, Any]
    key: str


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
) -> UnitsResult:
    """Compute what `store` lacks. Raises LuxError naming the failures above `max_failed_ratio`."""
    result, missing = _split(units, store)
    rows = [(str(store.root), u.key, u.function, u.arguments, limits) for u in missing]
    with progress(label, len(missing), "units", quiet=not missing) as bar:
        for index, outcome in (executor or SerialExecutor()).run(_compute, rows):
            _record(result, store, missing[index], outcome)
            bar.advance(failed=len(result.failed), reused=result.reused)
    if result.failed:
        _quarantine(store, result.failed)
    if len(result.failed) > max_failed_ratio * len(units):
        name, reason = next(iter(sorted(result.failed.items())))
        raise LuxError(f"{len(result.failed)} of {len(units)} {label} failed: {name}: {reason}")
    return result


def missing_units(units: Sequence[Unit], store: UnitStore) -> list[Unit]:
    """The units that a run would compute."""
    return [u for u in units if not store.has(u.key)]


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


def _record(result: UnitsResult, store: UnitStore, unit: Unit, outcome: Any) -> None:
    if outcome is None:
        result.folders[unit.name] = store.path(unit.key)
    else:
        result.failed[unit.name] = str(outcome) or type(outcome).__name__


def _compute(
    root: str, key: str, function: str, arguments: dict[str, Any], limits: Limits | None
) -> str | None:
    """Run one unit in whatever process this is; a reason comes back instead of an exception."""
    try:
        UnitStore(Path(root)).put(key, lambda out: run_guarded(function, out, arguments, limits))
    except LuxError as error:
        return str(error)
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return None


def _quarantine(store: UnitStore, failed: dict[str, str]) -> None:
    store.root.mkdir(parents=True, exist_ok=True)
    with open(store.root / "quarantine.jsonl", "a", encoding="utf-8") as stream:
        for name, reason in sorted(failed.items()):
            stream.write(json.dumps({"unit": name, "reason": reason}) + "\n")
