"""One mlflow run per stage: metrics and parameters in one batch, pictures, revision and digests."""

from __future__ import annotations

import getpass
import os
import subprocess
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from luxcore.files.digests import tree_digest
from luxcore.settings.base import Settings
from tasks.context import StageContext
from tasks.system_metrics import Sample

if TYPE_CHECKING:
    from mlflow import MlflowClient
    from mlflow.entities import Metric

EXPERIMENT = "luxremix"
MAX_PARAM_LENGTH = 500
"""mlflow refuses longer values."""
MAX_BATCH = 1000
"""mlflow refuses more metrics at once."""
UNITS = (
    "psnr, _db: decibels, higher is better. ssim: 0 to 1. lpips, log_rmse: lower is better. "
    "_s: seconds. _mb: megabytes. _share: of all, 0 to 1. _deg: degrees."
)


def log_stage(
    context: StageContext, does: str, seconds: float, peak_mb: float, samples: list[Sample]
) -> None:
    """Write the stage's run to the tracking store, with the times at which it really ran."""
    from mlflow.entities import Metric, Param, RunTag

    client = tracking_client(context.root)
    now = int(time.time() * 1000)
    run = client.create_run(
        experiment_id(client, context.root),
        start_time=now - int(seconds * 1000),
        run_name=context.name,
        tags=_tags(context, does),
    )
    run_id = run.info.run_id
    # The last point of a curve is its final value: given again, it would be drawn as a first point.
    curves = {name for name, _, _ in context.series}
    values = {name: value for name, value in context.metrics.items() if name not in curves}
    values |= {"wall_s": seconds, "peak_memory_mb": peak_mb}
    metrics = [Metric(name, value, now, 0) for name, value in values.items()]
    metrics += [Metric(name, value, now, step) for name, value, step in context.series]
    for step, sample in enumerate(samples):
        metrics += [Metric(n, v, sample.time_ms, step) for n, v in sample.values.items()]
    settings = flat_settings(context.name, context.settings)
    params = [Param(name, value) for name, value in {"seed": str(context.seed), **settings}.items()]
    digest = RunTag("artifact_sha256", tree_digest([context.out], context.root))
    client.log_batch(run_id, [], params, [digest], synchronous=True)
    log_metrics(client, run_id, metrics)
    _log_pictures(client, run_id, context)
    client.set_terminated(run_id)


def tracking_uri(root: Path) -> str:
    """`MLFLOW_TRACKING_URI`, or a sqlite file in the project."""
    return os.environ.get("MLFLOW_TRACKING_URI", f"sqlite:///{root / 'mlflow.db'}")


def tracking_client(root: Path) -> MlflowClient:
    """A client of the project's tracking store."""
    os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
    from mlflow import MlflowClient

    return MlflowClient(tracking_uri(root))


def experiment_id(client: MlflowClient, root: Path) -> str:
    """The project's experiment, made where it is missing."""
    experiment = client.get_experiment_by_name(EXPERIMENT)
    if experiment is not None:
        return str(experiment.experiment_id)
    # Named, since mlflow would take the folder that the command happens to run in.
    return str(client.create_experiment(EXPERIMENT, (root.resolve() / "mlruns").as_uri()))


def log_metrics(client: MlflowClient, run_id: str, metrics: list[Metric]) -> None:
    """As few batches as mlflow allows."""
    for first in range(0, len(metrics), MAX_BATCH):
        client.log_batch(run_id, metrics[first : first + MAX_BATCH], synchronous=True)


def common_tags(root: Path, source: str, description: str) -> dict[str, str]:
    """What mlflow's table shows of every run: who, which command, which revision, about what."""
    return {
        "git_revision": git_revision(root),
        "mlflow.user": getpass.getuser(),
        "mlflow.source.name": source,
        "mlflow.source.type": "LOCAL",
        "mlflow.source.git.commit": _git(root, "rev-parse", "HEAD"),
        "mlflow.note.content": description,
    }


def git_revision(root: Path) -> str:
    """The commit that is checked out, with "-dirty" where tracked files were changed."""
    return _git(root, "describe", "--always", "--dirty", "--abbrev=12")


def flat_settings(prefix: str, settings: Settings) -> dict[str, str]:
    """`splat.iterations` → "800", cut to the length that mlflow takes."""
    flat: dict[str, str] = {}

    def walk(name: str, value: Any) -> None:
        if isinstance(value, dict):
            for key, inner in value.items():
                walk(f"{name}.{key}", inner)
        else:
            flat[name] = str(value)[:MAX_PARAM_LENGTH]

    walk(prefix, settings.model_dump(mode="json"))
    return flat


def _git(root: Path, *arguments: str) -> str:
    done = subprocess.run(
        ["git", "-C", str(root), *arguments], capture_output=True, text=True, check=False
    )
    return done.stdout.strip() or "unknown"


def _tags(context: StageContext, does: str) -> dict[str, str]:
    source, about = f"python -m tasks {context.name}", f"{does}\n\n{UNITS}"
    tags = {"stage": context.name, **common_tags(context.root, source, about)}
    parent = os.environ.get("LUX_MLFLOW_PARENT")
    return {**tags, "mlflow.parentRunId": parent} if parent else tags


def _log_pictures(client: MlflowClient, run_id: str, context: StageContext) -> None:
    for name, picture in context.pictures.items():
        if isinstance(picture, Path):
            # A folder per name: files of two captures may be called the same.
            client.log_artifact(run_id, str(picture), f"pictures/{name}")
        else:
            client.log_image(run_id, picture.clip(0, 1), f"pictures/{name}.png")
