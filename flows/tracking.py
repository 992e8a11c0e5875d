"""The parent mlflow run of a flow; stages, run as processes, nest under it by its id."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from luxcore.evaluate.table import headlines
from luxcore.settings.load import load_settings
from tasks.context import STAGE_NAMES, metrics_file
from tasks.tracking import (
    UNITS,
    common_tags,
    experiment_id,
    flat_settings,
    log_metrics,
    tracking_client,
)

if TYPE_CHECKING:
    from mlflow import MlflowClient


@dataclass(frozen=True)
class FlowRecord:
    """The parent run while the flow runs."""

    client: MlflowClient
    run_id: str
    root: Path
    began: float = field(default_factory=time.monotonic)

    def log_parameters(self) -> None:
        """All of `params.yaml`, so that two flows are compared without opening their stages."""
        from mlflow.entities import Param

        settings = load_settings(self.root / "params.yaml")
        values = {"seed": str(settings.seed)}
        for name in STAGE_NAMES:
            values |= flat_settings(name, getattr(settings, name))
        params = [Param(name, value) for name, value in values.items()]
        for first in range(0, len(params), 100):
            self.client.log_batch(self.run_id, params=params[first : first + 100])

    def log_outcome(self, states: Mapping[str, str]) -> None:
        """State of each stage, and the headline scores where the evaluation is up to date."""
        from mlflow.entities import Metric

        for state in sorted(set(states.values())):
            names = ", ".join(name for name, found in states.items() if found == state)
            self.client.set_tag(self.run_id, f"stages_{state.lower()}", names)
        values = {"wall_s": time.monotonic() - self.began}
        scores = self.root / metrics_file("evaluate")
        if states.get("evaluate", "Failed") != "Failed" and scores.is_file():
            values |= headlines(json.loads(scores.read_text(encoding="utf-8")))
        now = int(time.time() * 1000)
        metrics = [Metric(name, value, now, 0) for name, value in values.items()]
        log_metrics(self.client, self.run_id, metrics)


@contextmanager
def flow_run(root: Path, name: str) -> Iterator[FlowRecord]:
    """Open a parent run called `name` and tell it to the stages through the environment."""
    client = tracking_client(root.resolve())
    tags = {"stage": "flow", **common_tags(root, "lux run", f"a flow over all stages\n\n{UNITS}")}
    run = client.create_run(experiment_id(client, root), run_name=name, tags=tags)
    record = FlowRecord(client, run.info.run_id, root)
    os.environ["LUX_MLFLOW_PARENT"] = record.run_id
    try:
        record.log_parameters()
        yield record
        client.set_terminated(record.run_id)
    except BaseException:
        client.set_terminated(record.run_id, "FAILED")
        raise
    finally:
        os.environ.pop("LUX_MLFLOW_PARENT", None)
