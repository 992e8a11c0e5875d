"""Stage report: pictures, tables and curves on one page, and an explorer for each capture."""

from __future__ import annotations

from typing import Any

from luxcore.files.digests import tree_digest
from luxcore.report import write_explorers, write_report
from tasks.context import STAGE_NAMES, StageContext
from tasks.tracking import git_revision


def run(stage: StageContext) -> None:
    """Write reports/index.html from the artifacts of every stage before it."""
    artifacts = stage.root / "artifacts"
    write_explorers(artifacts, stage.out)
    write_report(artifacts, stage.out, _provenance(stage))


def _provenance(stage: StageContext) -> dict[str, Any]:
    parameters = stage.params.model_dump(mode="json")
    stages = {
        name: {
            "digest": tree_digest([folder], stage.root),
            "params": parameters[name],
        }
        for name in STAGE_NAMES
        if (folder := stage.root / "artifacts" / name).is_dir()
    }
    return {"revision": git_revision(stage.root), "seed": stage.seed, "stages": stages}
