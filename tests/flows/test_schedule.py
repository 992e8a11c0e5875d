"""Schedules: what they build and where, and what they refuse before anything starts."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from flows.dag import upstream
from flows.dvc_runner import environment
from flows.schedule import changed_params, prepare_worktree, run_in_worktree
from luxcore.errors import InputError
from tests.flows.toy import TOY_STAGES, make_project, runs


def commit(root: Path, message: str) -> None:
    who = ["-c", "user.name=t", "-c", "user.email=t@example.org"]
    for arguments in (["add", "-A"], [*who, "commit", "-qm", message]):
        subprocess.run(["git", "-C", str(root), *arguments], check=True)


def test_upstream_is_everything_that_a_target_needs() -> None:
    assert upstream(["render"]) == {"rooms"}
    assert upstream(["rooms"]) == set()
    assert {"splat", "harmonize", "render"} <= upstream(["evaluate"])
    assert "report" not in upstream(["evaluate"])


def test_the_worktree_follows_the_project_and_shares_its_cache(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, prefect_server: None
) -> None:
    import flows.pipeline as pipeline
    import flows.schedule as schedule

    monkeypatch.setattr(pipeline, "ordered", lambda: TOY_STAGES)
    monkeypatch.setattr(schedule, "ordered", lambda: TOY_STAGES)
    monkeypatch.setenv("PREFECT_HOME", str(tmp_path / "home"))
    for name in ("LUX_UNITS", "MLFLOW_TRACKING_URI"):
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)
    root, place = make_project(tmp_path / "project"), tmp_path / "nightly"
    commit(root, "first")
    subprocess.run(
        [sys.executable, "-m", "dvc", "repro", "-q"], cwd=root, env=environment(), check=True
    )
    said = run_in_worktree(root, place, ["render"], [])
    assert said == f"2 stages are up to date in {place}."
    assert (place / "artifacts/render/value").read_text() == "2"
    # Taken from the project's cache: nothing ran in the worktree.
    assert runs(place) == []
    assert not (place / ".dvc" / "cache").exists()

    run_in_worktree(root, place, ["render"], ["seed=5"])
    assert (place / "artifacts/render/value").read_text() == "12"
    assert (root / "params.yaml").read_text() == "seed: 0\n"
    assert (root / "mlflow.db").is_file()
    assert not (place / "mlflow.db").exists()

    (root / "second.py").write_text((root / "second.py").read_text() + "# newer\n")
    commit(root, "second")
    prepare_worktree(root, place)
    assert (place / "second.py").read_text().endswith("# newer\n")
    assert (place / "params.yaml").read_text() == "seed: 0\n"


def test_a_checkout_of_somebody_is_never_overwritten(tmp_path: Path) -> None:
    root = make_project(tmp_path / "project")
    commit(root, "first")
    theirs = tmp_path / "theirs"
    subprocess.run(["git", "-C", str(root), "worktree", "add", "-q", str(theirs)], check=True)
    for place in (root, theirs):
        (place / "second.py").write_text("a change that is nowhere else\n")
        with pytest.raises(InputError, match=r"(project|theirs) is a checkout that `lux schedule`"):
            prepare_worktree(root, place)
        assert (place / "second.py").read_text() == "a change that is nowhere else\n"


def test_changes_reach_the_parameters_or_are_refused(project_root: Path) -> None:
    path = project_root / "params.yaml"
    changed = yaml.safe_load(changed_params(path, ["rooms.train=200", "seed=7"]))
    assert (changed["rooms"]["train"], changed["seed"]) == (200, 7)
    with pytest.raises(InputError, match=r"unknown key rooms\.trian; did you mean train"):
        changed_params(path, ["rooms.trian=2"])
    with pytest.raises(InputError, match=r"--set takes STAGE\.NAME=VALUE"):
        changed_params(path, ["rooms.train"])
    with pytest.raises(InputError, match=r"--set takes STAGE\.NAME=VALUE"):
        changed_params(path, ["nowhere.at.all=1"])
