"""One mlflow run per stage: metrics and parameters in one batch, pictures, revision and digests."""

from __future__ import annotations

import os
import subprocess
import time
from pathlib import Path
from typing import Any

from luxcore.files.digests import tree_digest
from tasks.context import StageContext

EXPERIMENT = "luxremix"
MAX_PARAM_LENGTH = 500
"""mlflow refuses longer values."""


def log_stage(context: StageContext, seconds: float, peak_mb: float) -> None:
    """Write the stage's run to the tracking store."""
    os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
    from mlflow import MlflowClient
    from mlflow.entities import Metric, Param, RunTag

    client = MlflowClient(tracking_uri(context.root))
    experiment = client.get_experiment_by_name(EXPERIMENT)
    experiment_id = experiment.experiment_id if experiment else client.create_experiment(EXPERIMENT)
    tags = _tags(context)
    run = client.create_run(experiment_id, run_name=context.name, tags=tags)
    now = int(time.time() * 1000)
    values = {**context.metrics, "wall_s": seconds, "peak_memory_mb": peak_mb}
    metrics = [Metric(name, value, now, 0) for name, value in values.items()]
    metrics += [Metric(name, value, now, step) for name, value, step in context.series]
    params = [Param(k, str(v)[:MAX_PARAM_LENGTH]) for k, v in _flat_params(context).items()]
    digest = tree_digest([context.out], context.root)
    client.log_batch(
        run.info.run_id, metrics, params, [RunTag("artifact_sha256", digest)], synchronous=True
    )
    _log_pictures(client, run.info.run_id, context)
    client.set_terminated(run.info.run_id)


def tracking_uri(root: Path) -> str:
    """`MLFLOW_TRACKING_URI`, or a sqlite file in the project."""
    return os.environ.get("MLFLOW_TRACKING_URI", f"sqlite:///{root / 'mlflow.db'}")


def git_revision(root: Path) -> str:
    """The commit that is checked out, with "-dirty" where tracked files were changed."""
    command = ["git", "-C", str(root), "describe", "--always", "--dirty", "--abbrev=12"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stdout.strip() or "unknown"


def _tags(context: StageContext) -> dict[str, str]:
    tags = {
        "stage": context.name,
        "git_revision": git_revision(context.root),
    }
    parent = os.environ.get("LUX_MLFLOW_PARENT")
    if parent:
        tags["mlflow.parentRunId"] = parent
    return tags


def _flat_params(context: StageContext) -> dict[str, Any]:
    flat: dict[str, Any] = {"seed": context.seed}

    def walk(prefix: str, value: Any) -> None:
        if isinstance(value, dict):
            for key, inner in value.items():
                walk(f"{prefix}.{key}", inner)
        else:
            flat[prefix] = value

    walk(context.name, context.settings.model_dump(mode="json"))
    return flat


def _log_pictures(client: Any, run_id: str, context: StageContext) -> None:
    for name, picture in context.pictures.items():
        if isinstance(picture, Path):
            # A folder per name: files of two captures may be called the same.
            client.log_artifact(run_id, str(picture), f"pictures/{name}")
        else:
            client.log_image(run_id, picture.clip(0, 1), f"pictures/{name}.png")
