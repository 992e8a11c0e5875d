"""Which flow runs are alive, and the burial of those that a kill or a crash left "Running".

The process of a flow run holds a lock on a file; the kernel frees the lock at any death. A file
without a holder whose run has no final state is a run that ended without a word. Runs of other
machines that report to the same server have no file here, so they are never touched.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

FOLDER = "living"
PAGE = 200
"""Prefect gives no more at once; a flow has a task a stage and their retries."""
_held: list[TextIO] = []
"""Open files, so that their locks last."""
_MESSAGE = "its process ended without a word: killed, or the machine went down"


def live(home: Path, run_id: str) -> Callable[[str, str], None]:
    """Hold the file of `run_id` below `home` until this process ends, and bury the dead.

    Not until the flow ends: its last state is reported after that. Returns
    `note(tracking_uri, mlflow_run_id)`, which names the run of mlflow that ends with this one.
    """
    bury_dead_runs(home)
    folder = home / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    new = folder / f".{run_id}.{os.getpid()}"
    stream = open(new, "w", encoding="utf-8")  # noqa: SIM115
    # Locked before it has its name: between the two it would look dead.
    fcntl.flock(stream, fcntl.LOCK_EX)
    os.replace(new, folder / f"{run_id}.json")
    _held.append(stream)

    def note(tracking_uri: str, mlflow_run_id: str) -> None:
        json.dump({"tracking_uri": tracking_uri, "mlflow_run_id": mlflow_run_id}, stream)
        stream.flush()

    return note


def dead_runs(home: Path) -> list[Path]:
    """Files of runs that nothing holds any more."""
    return [path for path in sorted((home / FOLDER).glob("*.json")) if not _is_held(path)]


def bury_dead_runs(home: Path) -> list[str]:
    """Mark dead runs and their tasks as Crashed, in mlflow as killed; returns the runs' names.

    Talks to the server that Prefect's settings name. A file goes only after its run was marked.
    """
    names = []
    for path in dead_runs(home):
        name = _mark_in_prefect(path.stem)
        _mark_in_mlflow(path)
        path.unlink(missing_ok=True)
        names += [name] if name else []
    return names


def _is_held(path: Path) -> bool:
    try:
        with open(path, encoding="utf-8") as stream:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
            return False
    except BlockingIOError:
        return True
    except FileNotFoundError:
        return True


def _mark_in_prefect(run_id: str) -> str | None:
    from uuid import UUID

    from prefect.client.orchestration import get_client
    from prefect.client.schemas.filters import FlowRunFilter, FlowRunFilterId
    from prefect.client.schemas.sorting import TaskRunSort
    from prefect.exceptions import ObjectNotFound
    from prefect.states import Crashed

    key, newest = UUID(run_id), TaskRunSort.EXPECTED_START_TIME_DESC
    with get_client(sync_client=True) as client:
        try:
            run = client.read_flow_run(key)
        except ObjectNotFound:
            return None
        ours: Any = FlowRunFilter(id=FlowRunFilterId(any_=[key]))
        for task in client.read_task_runs(flow_run_filter=ours, sort=newest, limit=PAGE):
            if task.state is None or not task.state.is_final():
                client.set_task_run_state(task.id, Crashed(message=_MESSAGE), force=True)
        if run.state is not None and run.state.is_final():
            return None
        client.set_flow_run_state(key, Crashed(message=_MESSAGE), force=True)
    return run.name


def _mark_in_mlflow(path: Path) -> None:
    try:
        note = json.loads(path.read_text(encoding="utf-8"))
    except ValueError:
        # It died before it could name its run of mlflow, or while it did so.
        return
    from mlflow import MlflowClient
    from mlflow.exceptions import MlflowException

    client = MlflowClient(note["tracking_uri"])
    try:
        if client.get_run(note["mlflow_run_id"]).info.status == "RUNNING":
            client.set_terminated(note["mlflow_run_id"], "KILLED")
    except MlflowException:
        # A store that was moved or emptied has nothing left to mark.
        return
