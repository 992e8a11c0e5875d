"""The flow that a schedule starts. A module of its own: importing Prefect needs its settings."""

from __future__ import annotations

import signal
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from prefect import flow, get_run_logger
from prefect.client.orchestration import get_client
from prefect.client.schemas.filters import (
    DeploymentFilter,
    DeploymentFilterName,
    FlowFilter,
    FlowFilterName,
    FlowRunFilter,
)
from prefect.client.schemas.sorting import FlowRunSort
from prefect.runtime import flow_run as current_run
from prefect.states import Cancelled, Completed, Crashed, State

from flows.living import live
from flows.pipeline import run_name
from flows.prefect_settings import prefect_home
from flows.schedule import run_in_worktree
from luxcore.errors import BusyError
from luxcore.lifetime import die_with_parent
from tasks.process import stage_lock

NAME = "luxremix-scheduled"
PAGE = 200
"""Prefect gives no more at once; it plans at most 100 runs of a deployment ahead."""


@flow(name=NAME, flow_run_name=run_name, persist_result=False, validate_parameters=False)
def scheduled_run(
    root: str,
    worktree: str,
    targets: list[str] | None = None,
    changes: list[str] | None = None,
) -> State[Any]:
    """One scheduled run. Where the last is still running, say so and complete."""
    # Without this a killed `lux schedule` would leave a run that nobody sees. Not SIGTERM: Prefect
    # would go on for minutes, reporting it to a server that is gone.
    die_with_parent(signal.SIGKILL)
    project, logger = Path(root), get_run_logger()
    try:
        with stage_lock(project, "schedule"):
            live(prefect_home(project), str(current_run.id))
            outcome = run_in_worktree(project, Path(worktree), targets, changes or [])
    except BusyError:
        outcome = "the previous build is still going, so this one ends without doing anything."
        logger.info(outcome)
        return Completed(name="Skipped", message=outcome)
    logger.info(outcome)
    return Completed(message=outcome)


def clear_missed_runs(deployment: str) -> None:
    """Before a schedule is served: what an earlier server of it left behind comes to an end.

    Runs that were due while nothing listened are cancelled (they would all start at once), runs
    that were being started when their server died are marked as crashed. Only who holds the lock
    of the schedule may call this.
    """
    due: Any = FlowRunFilter.model_validate({"state": {"type": {"any_": ["SCHEDULED", "PENDING"]}}})
    of_deployment: Any = DeploymentFilter(name=DeploymentFilterName(any_=[deployment]))
    now = datetime.now(UTC)
    with get_client(sync_client=True) as client:
        runs = client.read_flow_runs(
            flow_filter=FlowFilter(name=FlowFilterName(any_=[NAME])),
            deployment_filter=of_deployment,
            flow_run_filter=due,
            sort=FlowRunSort.EXPECTED_START_TIME_ASC,
            limit=PAGE,
        )
        for run in runs:
            if run.state is not None and run.state.is_pending():
                state: State[Any] = Crashed(message="its schedule ended before it began")
            elif run.expected_start_time and run.expected_start_time < now:
                state = Cancelled(message="missed: no schedule was being served")
            else:
                continue
            client.set_flow_run_state(run.id, state, force=True)
