"""A flow that is killed does not stay "Running", in Prefect or in mlflow."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from flows.living import bury_dead_runs, dead_runs

HOLD = """
import sys, time
from pathlib import Path
from flows import living
living.bury_dead_runs = lambda home: []
note = living.live(Path(sys.argv[1]), sys.argv[2])
note(sys.argv[3], sys.argv[4])
print("living", flush=True)
time.sleep(600)
"""
FLOW = """
import sys, time
from pathlib import Path
from prefect import flow, task
from prefect.runtime import flow_run
from flows.living import live

@task
def stage():
    print("running", flow_run.id, flush=True)
    time.sleep(600)

@flow
def build():
    live(Path(sys.argv[1]), str(flow_run.id))
    stage()

build()
"""


def start(program: str, *arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", program, *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def test_a_run_is_dead_when_its_process_is_and_mlflow_is_told(tmp_path: Path) -> None:
    from mlflow import MlflowClient

    uri = f"sqlite:///{tmp_path / 'mlflow.db'}"
    client = MlflowClient(uri)
    run = client.create_run(client.create_experiment("x", (tmp_path / "runs").as_uri()))
    key = "00000000-0000-0000-0000-000000000001"
    process = start(HOLD, str(tmp_path), key, uri, run.info.run_id)
    assert process.stdout is not None
    assert process.stdout.readline() == "living\n"
    assert dead_runs(tmp_path) == []
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    (dead,) = dead_runs(tmp_path)
    assert dead.stem == key


def test_a_killed_flow_and_its_tasks_are_marked_as_crashed(
    tmp_path: Path, prefect_server: None
) -> None:
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.filters import FlowRunFilter, FlowRunFilterId
    from prefect.client.schemas.sorting import TaskRunSort
    from prefect.settings import PREFECT_API_URL

    os.environ["PREFECT_API_URL"] = str(PREFECT_API_URL.value())
    try:
        process = start(FLOW, str(tmp_path))
    finally:
        del os.environ["PREFECT_API_URL"]
    assert process.stdout is not None
    key = process.stdout.readline().split()[1]
    with get_client(sync_client=True) as client:

        def states() -> list[str]:
            ours = FlowRunFilter(id=FlowRunFilterId(any_=[key]))
            newest = TaskRunSort.EXPECTED_START_TIME_DESC
            runs = client.read_task_runs(flow_run_filter=ours, sort=newest, limit=10)
            return [run.state.name for run in runs]

        # Tasks reach the server through a queue, seconds after they have begun.
        deadline = time.monotonic() + 60
        while states() != ["Running"] and time.monotonic() < deadline:
            time.sleep(0.5)
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        assert client.read_flow_run(key).state.is_running()
        names = bury_dead_runs(tmp_path)
        run = client.read_flow_run(key)
        assert names == [run.name]
        assert run.state.is_crashed()
        assert states() == ["Crashed"]
    assert dead_runs(tmp_path) == []
    assert bury_dead_runs(tmp_path) == []
