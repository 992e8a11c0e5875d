"""Stage report: pictures, tables and curves on one page, and an explorer for each capture."""

from __future__ import annotations

from typing import Any

from luxcore.files.digests import tree_digest
from luxcore.report import write_explorers, write_report
from tasks.context import STAGE_NAMES, StageContext, artifact_folder
from tasks.tracking import git_revision


def run(stage: StageContext) -> None:
    """Write reports/index.html from the artifacts of every stage before it."""
    artifacts = stage.root / "artifacts"
    for name in _finished(stage):
        # Checks it against its manifest: pages of damaged pictures would look like results.
        stage.input(name)
    write_explorers(artifacts, stage.out)
    write_report(artifacts, stage.out, _provenance(stage))


def _provenance(stage: StageContext) -> dict[str, Any]:
    parameters = stage.params.model_dump(mode="json")
    stages = {
        name: {
            "digest": tree_digest([stage.root / artifact_folder(name)], stage.root),
            "params": parameters[name],
        }
        for name in _finished(stage)
    }
    return {"revision": git_revision(stage.root), "seed": stage.seed, "stages": stages}


def _finished(stage: StageContext) -> list[str]:
    """Stages that left artifacts; a report can be made of any of them."""
    names = (name for name in STAGE_NAMES if name != stage.name)
    return [name for name in names if (stage.root / artifact_folder(name)).is_dir()]
