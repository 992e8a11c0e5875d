"""The flow that a schedule starts. A module of its own: importing Prefect needs its settings."""

from __future__ import annotations

from pathlib import Path

from prefect import flow, get_run_logger
from prefect.client.orchestration import get_client
from prefect.client.schemas.filters import FlowRunFilter
from prefect.client.schemas.objects import StateType
from prefect.runtime import flow_run as current_run
from prefect.states import Crashed

from flows.schedule import run_in_worktree


@flow(name="luxremix-scheduled", persist_result=False, validate_parameters=False)
def scheduled_run(root: str, worktree: str, stages: list[str] | None = None) -> str:
    """Bring the worktree's artifacts up to date; one at a time."""
    outcome = run_in_worktree(Path(root), Path(worktree), stages)
    if "still running" not in outcome:
        bury_dead_runs(str(current_run.flow_name), str(current_run.id))
    get_run_logger().info(outcome)
    return outcome


def bury_dead_runs(flow_name: str, living: str) -> int:
    """Mark runs that a kill left "Running" as Crashed; only the holder of the lock may call this."""
    running = FlowRunFilter(state={"type": {"any_": [StateType.RUNNING]}})  # type: ignore[arg-type]
    with get_client(sync_client=True) as client:
        dead = [
            run
            for run in client.read_flow_runs(flow_run_filter=running)
            if str(run.id) != living and str(run.parent_task_run_id or "") == ""
        ]
        for run in dead:
            state = Crashed(message="its process ended without a word")
            client.set_flow_run_state(run.id, state, force=True)
    return len(dead)
