"""`lux run` and `lux plan` refuse a damaged project at once and in one sentence."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from flows.checks import LOCK_COPY, check_project, locked_stages
from flows.dvc_runner import keep_lock_copy, stale_stages
from flows.plan import make_plan
from luxcore.errors import InputError, LuxError
from tests.flows.toy import make_project

LOCK = "schema: '2.0'\nstages:\n  rooms:\n    cmd: exec python -m tasks rooms\n"


@pytest.fixture
def project(tmp_path: Path, project_root: Path) -> Path:
    """The files that the checks read, as they are shipped, and a lock."""
    root = tmp_path / "project"
    for folder in (".git", ".dvc"):
        (root / folder).mkdir(parents=True)
    for name in ("params.yaml", "dvc.yaml"):
        shutil.copyfile(project_root / name, root / name)
    (root / "dvc.lock").write_text(LOCK)
    return root


def text(name: str, content: bytes) -> Callable[[Path], object]:
    """Damage: the file `name` holds `content`."""
    return lambda root: (root / name).write_bytes(content)


def folder(name: str) -> Callable[[Path], None]:
    """Damage: a folder in the place of the file `name`."""

    def damage(root: Path) -> None:
        (root / name).unlink()
        (root / name).mkdir()

    return damage


def without_report(root: Path) -> None:
    """Damage: the last section of params.yaml is gone."""
    params = root / "params.yaml"
    params.write_text(params.read_text().split("\nreport:")[0])


DAMAGES: list[tuple[Callable[[Path], object], str]] = [
    (text("params.yaml", b"rendr: {}"), "params.yaml: unknown key rendr; did you mean render?"),
    (text("params.yaml", b"seed: many"), "params.yaml: seed: "),
    (text("params.yaml", b""), "params.yaml must hold sections, it is empty"),
    (text("params.yaml", b"seed: [1"), "params.yaml is not plain YAML: line 1"),
    (
        text("params.yaml", b"seed: 1\nseed: 2"),
        "params.yaml is not plain YAML: line 2: the key seed",
    ),
    (text("params.yaml", b"\xff"), "params.yaml is not text"),
    (folder("params.yaml"), "params.yaml is a folder"),
    (without_report, "params.yaml lacks report; `report: {}`"),
    (text("dvc.yaml", b"stages: [1"), "dvc.yaml is not plain YAML: line 1"),
    (text("dvc.yaml", b""), "dvc.yaml is not what DVC writes"),
    (text("dvc.yaml", b"stages: {rooms: {cmd: ls}}"), "dvc.yaml has no stage render"),
    (text("dvc.yaml", b"\xff"), "dvc.yaml is not text"),
    (folder("dvc.yaml"), "dvc.yaml is a folder"),
    (text(".dvc/config", b"[core"), ".dvc/config is not what DVC writes: Invalid line"),
    (text(".dvc/config.local", b"\xff"), ".dvc/config.local is not what DVC writes"),
    (text("dvc.lock", b"stages: [1"), "dvc.lock is not plain YAML"),
    (text("dvc.lock", b"- 1"), "dvc.lock is not what DVC writes"),
    (
        text("dvc.lock", b""),
        "dvc.lock is not what DVC writes: it holds no stages by name; remove it",
    ),
    (text("dvc.lock", b"\xff"), "dvc.lock is not text"),
    (folder("dvc.lock"), "dvc.lock is a folder"),
    (lambda root: (root / ".git").rmdir(), "is not in a git repository"),
    (lambda root: (root / ".dvc").rmdir(), "has no .dvc folder"),
]


@pytest.mark.parametrize(("damage", "fact"), DAMAGES)
def test_what_could_not_run_is_refused_in_one_sentence(project, damage, fact):
    check_project(project)
    damage(project)
    for refuse in (check_project, make_plan):
        with pytest.raises(InputError) as caught:
            refuse(project)
        assert str(caught.value).startswith(str(project))
        assert fact in str(caught.value)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("command", ["run", "plan"])
def test_both_commands_say_the_same_before_dvc_or_prefect_is_imported(project, command):
    (project / "params.yaml").write_text("rendr: {}")
    code = (
        "import sys\n"
        "from luxcore.cli import app\n"
        "from luxcore.errors import InputError\n"
        "try:\n"
        "    app.main(sys.argv[1:], standalone_mode=False)\n"
        "except InputError as error:\n"
        "    print(error, sorted({'dvc', 'prefect', 'mlflow'} & set(sys.modules)))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, command],
        cwd=project, capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[2])},
    )  # fmt: skip
    sentence = f"{project / 'params.yaml'}: unknown key rendr; did you mean render? []\n"
    assert done.stdout == sentence, done.stdout + done.stderr
    assert sorted(p.name for p in project.iterdir()) == [
        ".dvc", ".git", "dvc.lock", "dvc.yaml", "params.yaml",
    ]  # fmt: skip


def test_a_project_that_dvc_uses_without_git_is_none_of_our_business(project):
    (project / ".git").rmdir()
    (project / ".dvc" / "config").write_text("[core]\n    no_scm = true\n")
    check_project(project)


def test_what_only_dvc_can_see_is_one_sentence_too(project):
    (project / ".dvc" / "config").write_text("[core]\n    nope = true\n")
    with pytest.raises(LuxError, match=r"^DVC: config file error: .*\.$"):
        make_plan(project)


def test_the_first_sentence_of_dvc_is_told_not_its_last_line(tmp_path):
    root = make_project(tmp_path / "toy")
    (root / "dvc.yaml").write_text("stages: {rooms: {cmd: ls, cmd: ls}}")
    with pytest.raises(LuxError, match=r"^dvc status failed: .*dvc\.yaml.*\.$"):
        stale_stages(root)


def test_a_damaged_lock_never_takes_the_place_of_its_copy_which_is_named(project):
    keep_lock_copy(project)
    (project / "dvc.lock").write_text("stages: [1")
    keep_lock_copy(project)
    assert (project / LOCK_COPY).read_text() == LOCK
    with pytest.raises(InputError, match=f"copy {project / LOCK_COPY} over it"):
        locked_stages(project)
