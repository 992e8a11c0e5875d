"""`dvc.yaml`, generated from the DAG by `python -m flows.dvc_file`; a test holds it equal."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import yaml

from flows.dag import BY_NAME, STAGES, Stage
from flows.plots import PLOTS

HEADER = "# Generated from flows/dag.py by `python -m flows.dvc_file`; edit that file instead.\n"
DVC_FILE = Path(__file__).resolve().parents[1] / "dvc.yaml"


def render_dvc_yaml() -> str:
    """The text of `dvc.yaml`."""
    document = {
        "stages": {stage.name: _stage_entry(stage) for stage in STAGES},
        "plots": [plot.entry() for plot in PLOTS],
    }
    return HEADER + yaml.safe_dump(document, sort_keys=False, width=100)


def _stage_entry(stage: Stage) -> dict[str, Any]:
    inputs = [BY_NAME[name].folder for name in stage.needs]
    return {
        "desc": stage.does,
        # exec: dash would stay between dvc and the stage, which then would outlive a stopped dvc.
        "cmd": f"exec python -m tasks {stage.name}",
        "deps": sorted({*stage.watched_code, *inputs}),
        "params": sorted({"seed", *stage.sections}),
        "outs": [stage.folder],
        "metrics": [stage.metrics_file],
    }


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
def main() -> None:
    """Write dvc.yaml anew from the DAG."""
    DVC_FILE.write_text(render_dvc_yaml(), encoding="utf-8")
    click.echo(f"wrote {DVC_FILE.name} with {len(STAGES)} stages")


if __name__ == "__main__":
    main()
