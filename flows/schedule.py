"""Runs on a cron schedule: own git worktree, shared cache and units, one at a time."""

from __future__ import annotations

import asyncio
import logging
import multiprocessing
import os
import signal
import subprocess
from pathlib import Path

import yaml

from flows.dag import ordered, upstream
from flows.living import bury_dead_runs
from flows.prefect_settings import prefect_home
from flows.shared_server import kept_up, name_server
from luxcore.errors import BusyError, InputError, LuxError
from luxcore.files.atomic import atomic_file
from luxcore.settings.load import parse_settings, read_yaml
from tasks.process import stage_lock
from tasks.tracking import tracking_uri


def serve(
    root: Path, cron: str, targets: list[str] | None, worktree: Path | None, changes: list[str]
) -> None:
    """Serve the scheduled flow until interrupted, on a Prefect server that is kept up.

    `targets` are built with everything they need; `changes` are STAGE.NAME=VALUE for the
    worktree's parameters. Raises InputError for what cannot be scheduled, before anything starts.
    """
    root = root.resolve()
    changed_params(root / "params.yaml", changes)
    server = name_server(root)
    _check_cron(cron)
    place = default_worktree(root) if worktree is None else worktree.resolve()
    prepare_worktree(root, place)
    name = "-".join(targets or ["everything"])
    from flows.scheduled import clear_missed_runs, scheduled_run

    try:
        with stage_lock(root, f"schedule-{name}"), kept_up(server, root):
            clear_missed_runs(name)
            pages = os.environ["PREFECT_API_URL"].removesuffix("/api")
            print(f"{name}: runs at {cron!r} in {place}; pages at {pages}", flush=True)
            given = {"root": str(root), "worktree": str(place)}
            parameters = {**given, "targets": targets, "changes": changes}
            signal.signal(signal.SIGINT, _stop_at_once)
            try:
                scheduled_run.serve(
                    name, cron=cron, parameters=parameters, print_starting_message=False
                )
            except asyncio.CancelledError:
                print(f"{name}: the schedule was stopped.", flush=True)
            finally:
                _end_runs(root)
    except BusyError as error:
        raise LuxError(f"{name} is on a schedule already: {error}") from error


def _stop_at_once(number: int, frame: object) -> None:
    """Ctrl-C: Prefect would wait for the run to finish, so the run goes first."""
    _kill_children()
    try:
        loop = asyncio.get_running_loop()
    except RuntimeError:
        raise KeyboardInterrupt from None
    # Connections that end in the middle are no news now.
    logging.getLogger("asyncio").setLevel(logging.CRITICAL)
    # An exception raised here would hit whatever Prefect is doing, and could be swallowed.
    for work in asyncio.all_tasks(loop):
        loop.call_soon_threadsafe(work.cancel)


def _end_runs(root: Path) -> None:
    """A schedule that is stopped takes its run along while the server still listens.

    Units that are done are kept for the next run.
    """
    _kill_children()
    bury_dead_runs(prefect_home(root))


def _kill_children() -> None:
    for child in multiprocessing.active_children():
        child.kill()
        child.join()


def default_worktree(root: Path) -> Path:
    """Beside the project."""
    return root.parent / f"{root.name}-scheduled"


def prepare_worktree(root: Path, place: Path) -> None:
    """A detached worktree at the project's present commit, using the project's DVC cache.

    Raises InputError where `place` is somebody's own checkout.
    """
    revision = _git(root, "rev-parse", "HEAD")
    local = place / ".dvc" / "config.local"
    config = f"[cache]\n    dir = {root / '.dvc' / 'cache'}\n"
    if (place / ".git").exists():
        # A checkout or another worktree of a person may hold changes that are nowhere else.
        if (place / ".git").is_dir() or not local.is_file() or local.read_text() != config:
            raise InputError(
                f"{place} is a checkout that `lux schedule` did not make, and changes in it would "
                "be lost; name another folder with --worktree."
            )
        # Forced: what an earlier run left in tracked files is nobody's work.
        _git(place, "checkout", "--quiet", "--force", "--detach", revision)
    else:
        _git(root, "worktree", "prune")
        _git(root, "worktree", "add", "--quiet", "--detach", str(place), revision)
    with atomic_file(local) as path:
        path.write_text(config, encoding="utf-8")


def run_in_worktree(
    root: Path, worktree: Path, targets: list[str] | None, changes: list[str]
) -> str:
    """Bring the worktree's artifacts up to date with the project's present commit."""
    from flows.pipeline import pipeline

    prepare_worktree(root, worktree)
    if changes:
        params = changed_params(worktree / "params.yaml", changes)
        with atomic_file(worktree / "params.yaml") as path:
            path.write_text(params, encoding="utf-8")
    os.environ["LUX_UNITS"] = str(root / ".lux" / "units")
    # Records of all runs are in one place, where `lux dashboards` looks.
    os.environ["MLFLOW_TRACKING_URI"] = tracking_uri(root)
    needed = None if targets is None else {*targets, *upstream(targets)}
    stages = None if needed is None else [s.name for s in ordered() if s.name in needed]
    done = pipeline(stages, str(worktree))
    return f"{len(done)} stages are up to date in {worktree}."


def changed_params(path: Path, changes: list[str]) -> str:
    """The YAML of `path` with STAGE.NAME=VALUE put in. Raises InputError naming what is wrong."""
    values = read_yaml(path)
    for change in changes:
        where, equals, text = change.partition("=")
        *sections, name = where.split(".")
        place = values
        for section in sections:
            place = place.get(section) if isinstance(place, dict) else None
        if not equals or not isinstance(place, dict):
            raise InputError(f'--set takes STAGE.NAME=VALUE, got "{change}".')
        place[name] = yaml.safe_load(text)
    if changes:
        parse_settings(values, "--set")
    return yaml.safe_dump(values, sort_keys=False)


def _check_cron(cron: str) -> None:
    from prefect.client.schemas.schedules import CronSchedule
    from pydantic import ValidationError

    try:
        CronSchedule(cron=cron)
    except ValidationError as error:
        raise InputError(f'--cron takes five fields as in "0 3 * * *", got "{cron}".') from error


def _git(folder: Path, *arguments: str) -> str:
    command = ["git", "-C", str(folder), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise LuxError(f"git {arguments[0]} in {folder} failed: {done.stderr.strip()}")
    return done.stdout.strip()
