"""The flow and `dvc repro` run one DAG: the same lock file, each a no-op after the other."""

from __future__ import annotations

import logging
import subprocess
import sys
import time
from pathlib import Path

import pytest

from flows.dvc_runner import NEVER_RUN, environment, reproduce, stale_stages
from luxcore.errors import LuxError
from tests.flows.toy import TOY_STAGES, dvc_repro, make_project, runs, set_seed


@pytest.fixture
def run_flow(monkeypatch, prefect_server):
    import flows.pipeline as pipeline

    monkeypatch.setattr(pipeline, "ordered", lambda: TOY_STAGES)
    return lambda root, stages=None: pipeline.run_pipeline(root, stages, 2)


def test_flow_and_repro_agree_and_changed_back_comes_from_the_cache(tmp_path, run_flow):
    by_flow = make_project(tmp_path / "with spaces é")
    by_repro = make_project(tmp_path / "plain")
    run_flow(by_flow)
    dvc_repro(by_repro)
    assert (by_flow / "dvc.lock").read_bytes() == (by_repro / "dvc.lock").read_bytes()
    assert "up to date" in dvc_repro(by_flow)
    run_flow(by_repro)
    assert runs(by_flow) == runs(by_repro) == ["rooms", "render"]

    set_seed(by_flow, 4)
    run_flow(by_flow)
    assert (by_flow / "artifacts/render/value").read_text() == "10"
    assert runs(by_flow) == ["rooms", "render"] * 2
    set_seed(by_flow, 0)
    run_flow(by_flow)
    assert (by_flow / "artifacts/render/value").read_text() == "2"
    assert runs(by_flow) == ["rooms", "render"] * 2


def test_a_failing_stage_is_one_sentence_and_upstream_is_kept(tmp_path, run_flow, caplog):
    root = make_project(tmp_path / "p", seed=200)
    # Prefect's loggers do not propagate.
    for name in ("prefect.flow_runs", "prefect.task_runs"):
        logging.getLogger(name).addHandler(caplog.handler)
    with pytest.raises(LuxError, match=r"render failed: the value is too large"):
        run_flow(root)
    assert "render failed: the value is too large" in caplog.text
    assert "Traceback" not in caplog.text
    assert (root / "artifacts/rooms/value").read_text() == "201"


def test_a_prefect_server_that_does_not_answer_is_one_sentence(tmp_path, monkeypatch):
    import flows.pipeline as pipeline

    def unreachable(**options):
        raise RuntimeError("Failed to reach API at http://127.0.0.1:9/api")

    monkeypatch.setattr(pipeline.pipeline, "with_options", unreachable)
    monkeypatch.setenv("PREFECT_API_URL", "http://127.0.0.1:9/api")
    with pytest.raises(LuxError, match=r"^no Prefect server answers at http://127\.0\.0\.1:9/api"):
        pipeline.run_pipeline(tmp_path, None, 1)


def test_reasons_and_outcomes_are_said_and_the_lock_is_copied_first(tmp_path):
    root = make_project(tmp_path / "p")
    assert stale_stages(root)["rooms"] == [NEVER_RUN]
    assert reproduce(root, "rooms") == "ran"
    before = (root / "dvc.lock").read_bytes()
    assert "rooms" not in stale_stages(root)
    set_seed(root, 1)
    assert "seed" in " ".join(stale_stages(root)["rooms"])
    assert reproduce(root, "rooms") == "ran"
    assert (root / ".lux" / "dvc.lock.before").read_bytes() == before
    assert reproduce(root, "rooms") == "unchanged"


@pytest.mark.parametrize("shell", ["/bin/sh", "/bin/bash"])
def test_a_stage_dies_with_dvc(tmp_path, project_root, shell):
    """SIGTERM to `dvc repro` must not leave a stage that goes on writing, whatever the shell."""
    root = make_project(tmp_path / "p")
    alive = root / "alive"
    (root / "first.py").write_text(
        f"import sys; sys.path.insert(0, {str(project_root)!r})\n"
        "from luxcore.lifetime import die_with_parent; die_with_parent()\n"
        "import time, pathlib\n"
        f"while True: pathlib.Path({str(alive)!r}).write_text(str(time.time())); time.sleep(0.05)\n"
    )
    command = [sys.executable, "-m", "dvc", "repro", "rooms"]
    process = subprocess.Popen(
        command,
        cwd=root,
        env={**environment(), "SHELL": shell},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    assert _eventually(alive.exists)
    process.terminate()
    process.wait()
    assert _eventually(lambda: _unchanged(alive))


def _unchanged(path: Path) -> bool:
    before = path.read_text()
    time.sleep(0.5)
    return path.read_text() == before


def _eventually(condition) -> bool:
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline:
        if condition():
            return True
        time.sleep(0.1)
    return False
