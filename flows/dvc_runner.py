"""Ask DVC whether a stage is stale, and let DVC run it. DVC is the only cache."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from flows.checks import LOCK_COPY, locked_stages, stages_of
from luxcore.errors import InputError, LuxError
from luxcore.files.atomic import atomic_file
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
        # Of a damaged YAML file it says which in the first line; where in the file is on others.
        raise LuxError(f"dvc status failed: {_dvc_error(done.stderr, otherwise=0)}")
    status = json.loads(done.stdout or "{}")
    known = locked_stages(root)
    return {name: stale_reasons(known, name, entries) for name, entries in status.items()}


def stale_reasons(known: set[str], name: str, entries: list[Any]) -> list[str]:
    """DVC's status of one stage (nested names and states) as phrases for people.

    To DVC everything is modified about a stage that is not among the `known` ones of
    `dvc.lock`; to people it is new.
    """
    if entries and name not in known:
        return [NEVER_RUN]
    return [phrase for entry in entries for phrase in _entry_phrases(entry)]


def reproduce(root: Path, stage: str) -> str:
    """Run one stage under DVC, its output passed through.

    Returns "ran", "cached" (taken from the run cache) or "unchanged". Raises LuxError where the
    stage fails.
    """
    keep_lock_copy(root)
    command = [*_DVC, "--wait-for-lock", "repro", "--single-item", stage]
    while not _stopping.is_set():
        process = subprocess.Popen(
            command,
            cwd=root,
            env=environment(),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            preexec_fn=die_with_parent,
        )
        with _among_running(process):
            tail = _forward(process)
        if process.returncode == 0:
            return _outcome(tail)
        if _stopping.is_set():
            break
        if BUSY not in tail:
            raise LuxError(f"stage {stage} failed: {_stage_error(tail)}")
        print(f"stage {stage} is being run by another process; waiting.", file=sys.stderr)
        _stopping.wait(BUSY_RETRY_S)
    raise LuxError(f"stage {stage} was stopped.")


def stop_stages() -> None:
    """End the stages that run now, and let none begin in this process; finished units are kept.

    The flow's threads wait for them, so that an interrupt would otherwise take hours.
    """
    _stopping.set()
    for process in list(_running):
        process.terminate()


@contextmanager
def _among_running(process: subprocess.Popen[str]) -> Iterator[None]:
    _running.add(process)
    if _stopping.is_set():
        process.terminate()
    try:
        yield
    finally:
        _running.discard(process)


def keep_lock_copy(root: Path) -> None:
    """DVC rewrites `dvc.lock` in place; the copy in `.lux` repairs it after a power cut."""
    lock = root / "dvc.lock"
    if not lock.is_file():
        return
    # A damaged lock, or one that another stage is rewriting now, leaves the older copy in place.
    with suppress(InputError), atomic_file(root / LOCK_COPY) as copy:
        shutil.copyfile(lock, copy)
        stages_of(copy)


@contextmanager
def said_by_dvc() -> Iterator[None]:
    """Raise DVC's own failures, which name file and fact in their first line, as LuxError."""
    from dvc.exceptions import DvcException

    try:
        yield
    except DvcException as error:
        raise LuxError(f"DVC: {_sentence(str(error))}") from error


_DVC = [sys.executable, "-m", "dvc"]
_running: set[subprocess.Popen[str]] = set()
_stopping = threading.Event()


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
    return own[-1] if own else _dvc_error(tail, otherwise=-1)


def _dvc_error(text: str, otherwise: int) -> str:
    """The last line that DVC marks as an error, or else the line of this number."""
    lines = [line for line in text.splitlines() if line.strip()] or ["no message"]
    marked = [line.removeprefix("ERROR: ") for line in lines if line.startswith("ERROR: ")]
    return _sentence(marked[-1] if marked else lines[otherwise])


def _sentence(text: str) -> str:
    first = text.strip().splitlines()[0].strip()
    return f"{first.rstrip('.:')}."


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
