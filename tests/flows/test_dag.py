"""The DAG as data: generated files equal it, and the task modules read what they declare."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from flows.dag import BY_NAME, STAGES, ordered
from flows.dvc_file import DVC_FILE, render_dvc_yaml
from tasks.context import STAGE_NAMES

NEVER_IN_A_RESULT = (
    "luxcore/__init__.py",
    "luxcore/errors.py",
    "luxcore/lifetime.py",
    "luxcore/progress.py",
    "luxcore/settings/",
)
"""The version, sentences, processes and bars; and settings, whose values are dependencies."""


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


@pytest.mark.parametrize("name", [name for name in STAGE_NAMES if name != "report"])
def test_a_stage_reads_exactly_what_it_declares(project_root, name):
    """An undeclared input would make DVC skip a stage that is stale."""
    source = (project_root / "tasks" / f"{name}.py").read_text()
    read = set(re.findall(r"\.input\(\s*\"(\w+)\"\s*\)", source))
    read |= {"capture"} if ".captures" in source else set()
    assert read == set(BY_NAME[name].needs)


@pytest.mark.parametrize("name", STAGE_NAMES)
def test_a_stage_declares_the_sections_of_other_stages_that_it_reads(project_root, name):
    source = (project_root / "tasks" / f"{name}.py").read_text()
    assert set(re.findall(r"\.params\.(\w+)\.", source)) == set(BY_NAME[name].settings)


def test_the_report_follows_every_other_stage():
    assert set(BY_NAME["report"].needs) == set(STAGE_NAMES) - {"report"}


@pytest.mark.parametrize("name", STAGE_NAMES)
def test_declared_code_exists(project_root, name):
    for path in BY_NAME[name].code:
        assert (project_root / path).exists()


@pytest.mark.parametrize("name", STAGE_NAMES)
def test_code_that_a_stage_imports_makes_it_stale(project_root, name):
    """A stage whose code changed would otherwise be taken from DVC's cache."""
    watched = [project_root / path for path in BY_NAME[name].watched_code]
    unwatched = [
        str(file.relative_to(project_root))
        for file in _reached(project_root, project_root / "tasks" / f"{name}.py")
        if not any(file == path or path in file.parents for path in watched)
    ]
    assert [file for file in unwatched if not file.startswith(NEVER_IN_A_RESULT)] == []


def _reached(root: Path, start: Path) -> set[Path]:
    """Files of luxcore that running `start` may load, found without running anything.

    Backends of `luxcore.models.backends` are loaded by name and so are not among them.
    """
    found, waiting = {start}, [start]
    while waiting:
        loaded = {file for name in _imported(waiting.pop()) for file in _files(root, name)}
        waiting += sorted(loaded - found)
        found |= loaded
    own = (file for file in found if root / "luxcore" in file.parents)
    # A docstring alone, as in most __init__.py, changes nothing.
    return {file for file in own if len(_parsed(file).body) > 1}


@cache
def _parsed(file: Path) -> ast.Module:
    return ast.parse(file.read_text())


def _imported(file: Path) -> Iterator[str]:
    for node in ast.walk(_parsed(file)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def _files(root: Path, name: str) -> Iterator[Path]:
    """What importing `name`, perhaps a name within a module, runs: its packages and itself."""
    parts = name.split(".") if name.startswith(("luxcore.", "tasks.")) else []
    for end in range(1, len(parts) + 1):
        place = root.joinpath(*parts[:end])
        yield from (f for f in (place / "__init__.py", place.with_suffix(".py")) if f.is_file())
