"""The Prefect flow over the DAG: order, retries, concurrency and sight; DVC does the caching."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

# Prefect reads these at import; a run must not depend on a server elsewhere or phone home.
os.environ.setdefault("PREFECT_SERVER_ANALYTICS_ENABLED", "false")
os.environ.setdefault("DO_NOT_TRACK", "true")
os.environ.setdefault("PREFECT_SERVER_EPHEMERAL_STARTUP_TIMEOUT_SECONDS", "600")
os.environ.setdefault("PREFECT_LOGGING_TO_API_WHEN_MISSING_FLOW", "ignore")

from prefect import flow, get_run_logger, task
from prefect.artifacts import create_link_artifact, create_markdown_artifact
from prefect.cache_policies import NO_CACHE
from prefect.futures import PrefectFuture
from prefect.states import Completed, State
from prefect.task_runners import ThreadPoolTaskRunner

from flows.dag import Stage, ordered
from flows.dvc_runner import reproduce, stale_stages
from flows.tracking import flow_run
from luxcore.errors import LuxError

RETRY_DELAY_S = 5
_STATE_NAMES = {"ran": "Completed", "cached": "Cached", "unchanged": "Skipped"}


@task(cache_policy=NO_CACHE, persist_result=False, task_run_name="{name}")
def stage_task(name: str, does: str, root: str, why: str) -> State:
    """Let DVC run one stage; `why` is the reason it was found stale, empty where it is fresh."""
    if not why:
        return Completed(name="Skipped", message="up to date: nothing that it depends on changed")
    get_run_logger().info("%s (%s), because: %s", name, does, why)
    outcome = reproduce(Path(root), name)
    return Completed(name=_STATE_NAMES[outcome], message=why[:500])


@flow(name="luxremix", persist_result=False, validate_parameters=False)
def pipeline(stages: list[str] | None = None, root: str = ".") -> list[str]:
    """All stages in order, or only `stages`; returns the names that ran or were skipped."""
    chosen = [stage for stage in ordered() if stages is None or stage.name in stages]
    with flow_run(Path(root)):
        states = _submit(chosen, root)
    failed = [name for name, state in states.items() if state.is_failed()]
    _publish(Path(root), states)
    if failed:
        raise LuxError(f"the flow stopped: {_cause(states[failed[0]])}")
    return list(states)


def run_pipeline(root: Path, stages: list[str] | None, stages_at_once: int) -> list[str]:
    """Run the flow with at most `stages_at_once` stages side by side."""
    runner: Any = ThreadPoolTaskRunner(max_workers=stages_at_once)
    return pipeline.with_options(task_runner=runner)(stages, str(root))


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
    states: dict[str, State] = {}
    for name, future in futures.items():
        future.wait()
        states[name] = future.state
    return states


def _upstream_reason(stage: Stage, stale: dict[str, str]) -> str:
    changing = [name for name in stage.needs if stale.get(name)]
    return f"{', '.join(changing)} will change" if changing else ""


def _publish(root: Path, states: dict[str, State]) -> None:
    rows = [f"| {name} | {state.name} | {state.message or ''} |" for name, state in states.items()]
    table = "\n".join(["| stage | state | why |", "|---|---|---|", *rows])
    create_markdown_artifact(table, key="stages", description="What each stage did, and why")
    report = root.resolve() / "reports" / "index.html"
    if report.is_file():
        create_link_artifact(report.as_uri(), key="report", link_text="The report of this run")


def _cause(state: State) -> str:
    text = str(state.message or "no message.")
    return text.split("LuxError: ", 1)[-1].split("LuxError('", 1)[-1].rstrip("')")
