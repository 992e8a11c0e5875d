"""The DAG as data: generated files equal it, and the task modules read what they declare."""

from __future__ import annotations

import re

import pytest

from flows.dag import BY_NAME, STAGES, downstream, ordered
from flows.dvc_file import DVC_FILE, render_dvc_yaml
from tasks.context import STAGE_NAMES


def test_dvc_yaml_is_the_generated_one():
    assert DVC_FILE.read_text() == render_dvc_yaml()


def test_stages_are_the_settings_sections_and_task_modules(project_root):
    assert {s.name for s in STAGES} == set(STAGE_NAMES)
    for name in STAGE_NAMES:
        assert (project_root / "tasks" / f"{name}.py").is_file()


def test_order_respects_needs():
    seen: set[str] = set()
    for stage in ordered():
        assert set(stage.needs) <= seen
        seen.add(stage.name)


def test_downstream_of_masks_leaves_training_alone():
    assert "harmonize" in downstream("masks")
    assert not {"train_sv", "train_mv", "splat", "masks"} & downstream("masks")


@pytest.mark.parametrize("name", [name for name in STAGE_NAMES if name != "report"])
def test_a_stage_reads_exactly_what_it_declares(project_root, name):
    """An undeclared input would make DVC skip a stage that is stale."""
    source = (project_root / "tasks" / f"{name}.py").read_text()
    read = set(re.findall(r"\.input\(\s*\"(\w+)\"\s*\)", source))
    read |= {"capture"} if ".captures" in source else set()
    assert read == set(BY_NAME[name].needs)


def test_the_report_follows_every_other_stage():
    assert set(BY_NAME["report"].needs) == set(STAGE_NAMES) - {"report"}


@pytest.mark.parametrize("name", STAGE_NAMES)
def test_declared_code_exists(project_root, name):
    for path in BY_NAME[name].code:
        assert (project_root / path).exists()
