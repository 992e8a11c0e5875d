"""The parent mlflow run of a flow; stages, run as processes, nest under it by its id."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

from tasks.tracking import EXPERIMENT, git_revision, tracking_uri


@contextmanager
def flow_run(root: Path) -> Iterator[str]:
    """Open a parent run for the flow and name it to the stages through the environment."""
    os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
    from mlflow import MlflowClient

    client = MlflowClient(tracking_uri(root.resolve()))
    experiment = client.get_experiment_by_name(EXPERIMENT)
    experiment_id = experiment.experiment_id if experiment else client.create_experiment(EXPERIMENT)
    name = datetime.now().strftime("flow %Y-%m-%d %H:%M")
    tags = {"git_revision": git_revision(root), "stage": "flow"}
    run_id = client.create_run(experiment_id, run_name=name, tags=tags).info.run_id
    os.environ["LUX_MLFLOW_PARENT"] = run_id
    try:
        yield run_id
        client.set_terminated(run_id)
    except BaseException:
        client.set_terminated(run_id, "FAILED")
        raise
    finally:
        os.environ.pop("LUX_MLFLOW_PARENT", None)
