"""Ctrl-C and a termination end `lux run` within seconds; what it was doing is recorded."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from flows import dvc_runner
from luxcore.errors import LuxError
from tests.flows.toy import dvc_repro, make_project, runs

RUN = """
import sys
sys.argv = ["lux", "run"]
import flows.checks, flows.dag, flows.own_server
from tests.flows.toy import TOY_STAGES
flows.checks.check_project = lambda root: None
flows.dag.ordered = lambda: TOY_STAGES
from luxcore.cli import main
main()
"""
SLOW = """\
import pathlib, sys, time
sys.path.insert(0, {project!r})
from luxcore.lifetime import die_with_parent
die_with_parent()
pathlib.Path("begun").write_text("")
try:
    time.sleep(600)
except KeyboardInterrupt:
    sys.exit("lux: stopped.")
"""
PATIENCE_S = 200.0
END_S = 60.0
"""Prefect's default would be over a minute after a Ctrl-C, and the stage's own 600 s otherwise."""


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_ends_soon_is_recorded_and_can_be_run_again(
    tmp_path: Path, project_root: Path, how: signal.Signals
) -> None:
    root = make_project(tmp_path / "toy")
    usual = (root / "first.py").read_text()
    (root / "first.py").write_text(SLOW.format(project=str(project_root)))
    process = _start(root, project_root)
    assert _eventually((root / "begun").exists, PATIENCE_S), (root / "said").read_text()
    if how is signal.SIGINT:
        # As a terminal does: to all of the group at once.
        os.killpg(process.pid, how)
    else:
        process.send_signal(how)
    assert process.wait(END_S) == 130
    said = (root / "said").read_text()
    assert said.endswith("lux: stopped.\n")
    assert "Traceback" not in said
    with sqlite3.connect(root / ".lux" / "prefect" / "prefect.db") as database:
        assert database.execute("select state_type from flow_run").fetchall() == [("CRASHED",)]
    # Neither Prefect's server nor a stage is left: both would still hold their folder.
    assert _eventually(lambda: not _processes_in(root), 20.0)
    (root / "first.py").write_text(usual)
    dvc_repro(root)
    assert runs(root) == ["rooms", "render"]


def test_a_stage_that_waits_for_another_run_is_let_go_as_well(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dvc_runner, "_stopping", threading.Event())
    monkeypatch.setattr(dvc_runner, "_DVC", [sys.executable, "-c", "print('x is busy'); exit(1)"])
    threading.Timer(3.0, dvc_runner.stop_stages).start()
    with pytest.raises(LuxError, match="stage rooms was stopped"):
        dvc_runner.reproduce(tmp_path, "rooms")


def _start(root: Path, project: Path) -> subprocess.Popen[bytes]:
    own = {"PYTHONPATH": str(project), "PREFECT_HOME": str(root / ".lux" / "prefect")}
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("PREFECT", "MLFLOW"))}
    with open(root / "said", "wb") as said:
        return subprocess.Popen(
            [sys.executable, "-c", RUN], cwd=root, stdout=said, stderr=said,
            env={**kept, **own}, start_new_session=True,
        )  # fmt: skip


def _processes_in(folder: Path) -> list[str]:
    found = []
    for link in Path("/proc").glob("[0-9]*/cwd"):
        try:
            if link.resolve() == folder.resolve():
                found.append(link.parent.name)
        except OSError:
            continue
    return found


def _eventually(condition, seconds: float) -> bool:
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if condition():
            return True
        time.sleep(0.1)
    return False
