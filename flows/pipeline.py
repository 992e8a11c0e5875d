"""The Prefect flow over the DAG: order, retries, concurrency and sight; DVC does the caching."""

from __future__ import annotations

import logging
import os
from datetime import datetime
from pathlib import Path
from typing import Any

from prefect import flow, get_run_logger, task
from prefect.artifacts import (
    create_link_artifact,
    create_markdown_artifact,
    create_progress_artifact,
    update_progress_artifact,
)
from prefect.cache_policies import NO_CACHE
from prefect.futures import PrefectFuture
from prefect.runtime import flow_run as current_run
from prefect.states import Completed, State
from prefect.task_runners import ThreadPoolTaskRunner

from flows.dag import Stage, ordered
from flows.dashboards import REPORT_PORT
from flows.dvc_runner import reproduce, stale_stages, stop_stages
from flows.living import live
from flows.prefect_settings import prefect_home
from flows.servers import HOST
from flows.tracking import flow_run
from luxcore.errors import LuxError
from tasks.tracking import tracking_uri

RETRY_DELAY_S = 5
REPORT_ADDRESS = f"http://{HOST}:{REPORT_PORT}/index.html"
_STATE_NAMES = {"ran": "Completed", "cached": "Cached", "unchanged": "Skipped"}


@task(cache_policy=NO_CACHE, persist_result=False, task_run_name="{name}")
def stage_task(name: str, does: str, root: str, why: str) -> State:
    """Let DVC run one stage; `why` is the reason it was found stale, empty where it is fresh."""
    if not why:
        return Completed(name="Skipped", message="up to date: nothing that it depends on changed")
    get_run_logger().info("%s (%s), because: %s", name, does, why)
    outcome = reproduce(Path(root), name)
    return Completed(name=_STATE_NAMES[outcome], message=why[:500])


def run_name() -> str:
    """What a run is called in Prefect and in mlflow: what it builds, and since when."""
    given = current_run.parameters or {}
    names = given.get("targets") or given.get("stages") or ["everything"]
    what = ", ".join(names) if len(names) < 4 else f"{len(names)} stages"
    return f"{what}, {datetime.now():%Y-%m-%d %H:%M}"


@flow(name="luxremix", flow_run_name=run_name, persist_result=False, validate_parameters=False)
def pipeline(stages: list[str] | None = None, root: str = ".") -> list[str]:
    """All stages in order, or only `stages`; returns the names that ran or were skipped."""
    chosen = [stage for stage in ordered() if stages is None or stage.name in stages]
    place, name = Path(root), str(current_run.name)
    note = live(prefect_home(place), str(current_run.id))
    with flow_run(place, name) as parent:
        note(tracking_uri(place.resolve()), parent.run_id)
        try:
            states = _submit(chosen, root)
        except BaseException as error:
            # An interrupt or a termination, not a failure.
            if not isinstance(error, Exception):
                stop_stages()
            raise
        parent.log_outcome({name: state.name or "" for name, state in states.items()})
        _publish(place, states)
        failed = [name for name, state in states.items() if state.is_failed()]
        if failed:
            raise LuxError(f"the flow stopped: {_cause(states[failed[0]])}")
    return list(states)


def run_pipeline(root: Path, stages: list[str] | None, stages_at_once: int) -> list[str]:
    """Run the flow with at most `stages_at_once` stages side by side.

    Raises LuxError where a stage fails, or where Prefect's server does not answer.
    """
    runner: Any = ThreadPoolTaskRunner(max_workers=stages_at_once)
    for name in ("prefect.flow_runs", "prefect.task_runs"):
        logging.getLogger(name).addFilter(_without_traceback)
    try:
        return pipeline.with_options(task_runner=runner)(stages, str(root))
    except RuntimeError as error:
        if "Failed to reach API" not in str(error):
            raise
        address = os.environ.get("PREFECT_API_URL", "its address")
        raise LuxError(f"no Prefect server answers at {address} (PREFECT_API_URL).") from error


def _without_traceback(record: logging.LogRecord) -> bool:
    """Of a LuxError people need the sentence, not where in the code it was raised."""
    if record.exc_info and isinstance(record.exc_info[1], LuxError):
        record.exc_info = None
    return True


def _submit(chosen: list[Stage], root: str) -> dict[str, State]:
    stale = {name: "; ".join(reasons) for name, reasons in stale_stages(Path(root)).items()}
    futures: dict[str, PrefectFuture[State]] = {}
    for stage in chosen:
        why = stale.setdefault(stage.name, _upstream_reason(stage, stale))
        retrying = stage_task.with_options(retries=stage.retries, retry_delay_seconds=RETRY_DELAY_S)
        futures[stage.name] = retrying.submit(  # type: ignore[call-overload]
            stage.name,
            stage.does,
            root,
            why,
            wait_for=[futures[name] for name in stage.needs if name in futures],
        )
    bar: Any = create_progress_artifact(0.0, key="progress", description="Stages that are done")
    states: dict[str, State] = {}
    for name, future in futures.items():
        future.wait()
        states[name] = future.state
        update_progress_artifact(bar, 100 * len(states) / len(futures))
    return states


def _upstream_reason(stage: Stage, stale: dict[str, str]) -> str:
    changing = [name for name in stage.needs if stale.get(name)]
    return f"{', '.join(changing)} will change" if changing else ""


def _publish(root: Path, states: dict[str, State]) -> None:
    rows = [f"| {name} | {state.name} | {_why(state)} |" for name, state in states.items()]
    table = "\n".join(["| stage | state | why |", "|---|---|---|", *rows])
    create_markdown_artifact(table, key="stages", description="What each stage did, and why")
    report = root.resolve() / "reports" / "index.html"
    if report.is_file():
        # Browsers let no page open a file: the link leads to the server of `lux dashboards`.
        create_link_artifact(
            REPORT_ADDRESS,
            key="report",
            link_text="The report",
            description=f"Served by `lux dashboards`; the file is {report}",
        )


def _why(state: State) -> str:
    reasons = str(state.message or "").split("; ")
    # The first run of a project lists every file that it depends on.
    more = f"; and {len(reasons) - 4} more" if len(reasons) > 4 else ""
    return "; ".join(reasons[:4]) + more


def _cause(state: State) -> str:
    text = str(state.message or "no message.")
    return text.split("LuxError: ", 1)[-1].split("LuxError('", 1)[-1].rstrip("')")
