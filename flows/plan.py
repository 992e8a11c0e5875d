"""What a run would do: per stage fresh, cached or stale, missing units, time and disk, and why."""

from __future__ import annotations

import importlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from flows.checks import check_project, locked_stages
from flows.dag import Stage, ordered
from luxcore.errors import LuxError
from luxcore.settings.load import load_settings
from luxcore.units.runner import missing_units
from tasks.context import StageContext


@dataclass(frozen=True)
class StagePlan:
    """The forecast for one stage."""

    name: str
    state: str
    """fresh (nothing to do), cached (taken from DVC's run cache), stale or waiting (upstream)."""
    why: str
    units_missing: int | None
    units: int | None
    seconds: float | None
    """Wall time when it last ran here, scaled by the share of units that are missing."""
    megabytes: float | None
    """Size of its artifacts as they are now."""

    def row(self) -> dict[str, Any]:
        return asdict(self)


def make_plan(root: Path) -> list[StagePlan]:
    """The plan of a whole run. Nothing is written.

    Raises InputError where a run would refuse the project's files, LuxError where DVC does.
    """
    root = root.resolve()
    check_project(root)
    from dvc.repo import Repo

    from flows.dvc_runner import said_by_dvc

    known = locked_stages(root)
    plans: list[StagePlan] = []
    with said_by_dvc(), Repo(str(root)) as repo:
        for stage in ordered():
            upstream = [p.name for p in plans if p.name in stage.needs and p.state != "fresh"]
            plans.append(_plan_stage(root, repo, known, stage, upstream))
    return plans


def totals(plans: list[StagePlan]) -> tuple[int, float, bool]:
    """How many stages would run, their seconds, and whether all of them were ever timed."""
    due = [p for p in plans if p.state in ("stale", "waiting")]
    return len(due), sum(p.seconds or 0.0 for p in due), all(p.seconds is not None for p in due)


def _plan_stage(
    root: Path, repo: Any, known: set[str], stage: Stage, upstream: list[str]
) -> StagePlan:
    state, why = _state(repo, known, stage, upstream)
    missing, total = (None, None) if state in ("fresh", "cached") else _units(root, stage.name)
    seconds = 0.0 if state in ("fresh", "cached") else _last_seconds(root, stage.name)
    if seconds and missing is not None and total:
        seconds *= missing / total
    return StagePlan(stage.name, state, why, missing, total, seconds, _megabytes(root, stage))


def _state(repo: Any, known: set[str], stage: Stage, upstream: list[str]) -> tuple[str, str]:
    from dvc.stage.cache import RunCacheNotFoundError

    from flows.dvc_runner import stale_reasons

    entry = repo.stage.load_one(name=stage.name)
    if upstream:
        return "waiting", f"{', '.join(upstream)} will change"
    with repo.lock:
        status = entry.status(check_updates=False)
    reasons = stale_reasons(known, stage.name, status.get(entry.addressing, []))
    if not reasons:
        return "fresh", ""
    try:
        with repo.lock:
            entry.save_deps()
            for out in entry.outs:
                # Else the outputs of the last run, still at hand, are taken for those of the next.
                out.hash_info = type(out.hash_info)()
            repo.stage_cache.restore(entry, dry=True)
    except RunCacheNotFoundError:
        return "stale", "; ".join(reasons)
    return "cached", "; ".join(reasons)


def _units(root: Path, name: str) -> tuple[int | None, int | None]:
    """(missing, all) for stages that can list their units before they run."""
    try:
        module = importlib.import_module(f"tasks.{name}")
        if not hasattr(module, "units"):
            return None, None
        context = StageContext(name, load_settings(root / "params.yaml"), root)
        units = module.units(context)
    except LuxError:
        return None, None
    return len(missing_units(units, context.store)), len(units)


def _last_seconds(root: Path, name: str) -> float | None:
    path = root / "artifacts" / "timings" / f"{name}.json"
    try:
        return float(json.loads(path.read_text(encoding="utf-8"))["wall_s"])
    except (OSError, ValueError, KeyError, TypeError):
        # A forecast is no reason to stop: what was never timed here, or is damaged, is not known.
        return None


def _megabytes(root: Path, stage: Stage) -> float | None:
    folder = root / stage.folder
    if not folder.is_dir():
        return None
    return sum(f.stat().st_size for f in folder.rglob("*") if f.is_file()) / 1e6
