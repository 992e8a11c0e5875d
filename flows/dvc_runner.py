"""Ask DVC whether a stage is stale, and let DVC run it. DVC is the only cache."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import yaml

from luxcore.errors import LuxError
from luxcore.lifetime import die_with_parent

NEVER_RUN = "it has not run here yet"
BUSY_RETRY_S = 2.0
BUSY = "is busy"
"""DVC's word for a stage that is running elsewhere; `--wait-for-lock` does not cover it."""


def environment() -> dict[str, str]:
    """The environment of a `dvc` process: this interpreter first on PATH, for `cmd: python …`."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    return {**os.environ, "PATH": path, "PYTHONUNBUFFERED": "1"}


def stale_stages(root: Path) -> dict[str, list[str]]:
    """Stage → why DVC would run it, one phrase each. Stages that are up to date are not in it."""
    done = _dvc(root, "status", "--json")
    if BUSY in done.stderr:
        raise LuxError(f"another run is at work in {root}; wait for it to end.")
    if done.returncode != 0:
        raise LuxError(f"dvc status failed: {_last_line(done.stderr)}")
    status = json.loads(done.stdout or "{}")
    known = locked_stages(root)
    return {name: stale_reasons(known, name, entries) for name, entries in status.items()}


def stale_reasons(known: set[str], name: str, entries: list[Any]) -> list[str]:
    """DVC's status of one stage (nested names and states) as phrases for people.

    To DVC everything is modified about a stage that is not among the `known` ones of
    `locked_stages`; to people it is new.
    """
    if entries and name not in known:
        return [NEVER_RUN]
    return [phrase for entry in entries for phrase in _entry_phrases(entry)]


def locked_stages(root: Path) -> set[str]:
    """Stages that `dvc.lock` has a result of."""
    lock = root / "dvc.lock"
    if not lock.is_file():
        return set()
    return set((yaml.safe_load(lock.read_text()) or {}).get("stages", {}))


def reproduce(root: Path, stage: str) -> str:
    """Run one stage under DVC, its output passed through.

    Returns "ran", "cached" (taken from the run cache) or "unchanged". Raises LuxError where the
    stage fails.
    """
    keep_lock_copy(root)
    command = [*_DVC, "--wait-for-lock", "repro", "--single-item", stage]
    while True:
        process = subprocess.Popen(
            command,
            cwd=root,
            env=environment(),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            preexec_fn=die_with_parent,
        )
        tail = _forward(process)
        if process.returncode == 0:
            return _outcome(tail)
        if BUSY not in tail:
            raise LuxError(f"stage {stage} failed: {_stage_error(tail)}")
        print(f"stage {stage} is being run by another process; waiting.", file=sys.stderr)
        time.sleep(BUSY_RETRY_S)


def keep_lock_copy(root: Path) -> None:
    """DVC rewrites `dvc.lock` in place; the copy in `.lux` repairs it after a power cut."""
    lock = root / "dvc.lock"
    if lock.is_file() and lock.stat().st_size > 0:
        backup = root / ".lux" / "dvc.lock.before"
        backup.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(lock, backup)


_DVC = [sys.executable, "-m", "dvc"]


def _dvc(root: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*_DVC, "--wait-for-lock", *arguments],
        cwd=root,
        env=environment(),
        capture_output=True,
        text=True,
        check=False,
    )


def _forward(process: subprocess.Popen[str]) -> str:
    """Copy the child's output to standard error line by line; returns its last lines."""
    lines: list[str] = []
    assert process.stdout is not None
    try:
        for line in process.stdout:
            sys.stderr.write(line)
            lines = [*lines[-40:], line]
        process.wait()
    except BaseException:
        process.send_signal(signal.SIGTERM)
        raise
    return "".join(lines)


def _outcome(tail: str) -> str:
    if "didn't change, skipping" in tail:
        return "unchanged"
    return "cached" if "is cached - skipping run" in tail else "ran"


def _stage_error(tail: str) -> str:
    own = [line[5:] for line in tail.splitlines() if line.startswith("lux: ")]
    return own[-1] if own else _last_line(tail)


def _last_line(text: str) -> str:
    lines = [line for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else "no message."


def _entry_phrases(entry: Any) -> list[str]:
    if isinstance(entry, str):
        return [entry]
    phrases = []
    for kind, changes in entry.items():
        if isinstance(changes, dict):
            phrases += [f"{name} {_changed(kind, state)}" for name, state in changes.items()]
    return phrases


def _changed(kind: str, state: Any) -> str:
    if isinstance(state, dict):
        return "parameters changed: " + ", ".join(sorted(state))
    return f"{'output ' if kind == 'changed outs' else ''}{state}"
