"""The flow that a schedule starts. A module of its own: importing Prefect needs its settings."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from uuid import UUID

from prefect import flow, get_run_logger
from prefect.client.orchestration import get_client
from prefect.client.schemas.filters import FlowFilter, FlowFilterName, FlowRunFilter
from prefect.runtime import flow_run as current_run
from prefect.states import Crashed, State

from flows.schedule import run_in_worktree
from luxcore.errors import BusyError
from tasks.process import stage_lock

NAME = "luxremix-scheduled"


@flow(name=NAME, persist_result=False, validate_parameters=False)
def scheduled_run(root: str, worktree: str, stages: list[str] | None = None) -> str:
    """One scheduled run. Where the last is still running, say so and complete."""
    logger = get_run_logger()
    try:
        with stage_lock(Path(root), "schedule"):
            for name in bury_dead_runs(str(current_run.id)):
                logger.warning("run %s had died without a word; marked as crashed", name)
            outcome = run_in_worktree(Path(root), Path(worktree), stages)
    except BusyError as error:
        outcome = f"the previous build is still going, this one ends: {error}"
    logger.info(outcome)
    return outcome


def bury_dead_runs(living: str) -> list[str]:
    """Mark scheduled runs (and flows inside them) that a kill left "Running" as Crashed.

    Only the holder of the schedule's lock may call this: whoever else says Running is dead.
    """
    running: Any = FlowRunFilter.model_validate({"state": {"type": {"any_": ["RUNNING"]}}})
    with get_client(sync_client=True) as client:
        ours = client.read_flow_runs(
            flow_filter=FlowFilter(name=FlowFilterName(any_=[NAME])), flow_run_filter=running
        )
        inner = [r for r in client.read_flow_runs(flow_run_filter=running) if r.parent_task_run_id]
        dead = {run.id: run.name for run in [*ours, *inner] if str(run.id) != living}
        for run_id in dead:
            client.set_flow_run_state(UUID(str(run_id)), _crashed(), force=True)
    return sorted(dead.values())


def _crashed() -> State[Any]:
    return Crashed(message="its process ended without a word")
