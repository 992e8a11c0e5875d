"""The whole flow, killed in the middle of every stage, ends in the bytes of a quiet `dvc repro`."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from flows.dag import ordered
from flows.digests import SKIPPED
from flows.dvc_runner import environment
from tests.flows.toy import dvc_repro

pytestmark = [pytest.mark.slow, pytest.mark.blender, pytest.mark.timeout(3600)]

PATIENCE_S = 600.0
SMALL: dict[str, dict[str, Any]] = {
    "rooms": {"train": 1},
    "render": {"height": 48, "spp": 2, "demo_spp": 4},
    "train_sv": {"steps": 6, "groups": 4, "size_px": 48, "check_every": 3},
    "train_mv": {"steps": 6, "groups": 4, "size_px": 48, "check_every": 3},
    "splat": {"iterations": 120, "initial_gaussians": 2000, "checkpoint_every": 40},
    "relight": {"joint_iterations": 40, "frozen_iterations": 30, "checkpoint_every": 15},
    "evaluate": {"cases": 2, "size_px": 64},
}
"""Every stage with its real code, most of them in seconds; SfM wants the demo as large as it is."""


def make_copy(project: Path, root: Path) -> Path:
    """The tracked files of `project` as a repository of their own, with small parameters."""
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=project, check=True, capture_output=True, text=True
    )
    for name in filter(None, listed.stdout.split("\0")):
        target = root / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(project / name, target)
    subprocess.run(["git", "init", "-q"], cwd=root, check=True)
    params = yaml.safe_load((root / "params.yaml").read_text())
    for section, values in SMALL.items():
        params[section].update(values)
    (root / "params.yaml").write_text(yaml.safe_dump(params))
    return root


def start_flow(root: Path) -> subprocess.Popen[bytes]:
    """`lux run` in `root`; its output goes to the file `flow.log` there."""
    own = {"PREFECT_HOME": str(root / ".lux" / "prefect")}
    command = [sys.executable, "-c", "from luxcore.cli import main; main()", "run"]
    with open(root / "flow.log", "ab") as log:
        return subprocess.Popen(
            command, cwd=root, env={**environment(), **own}, stdout=log, stderr=log
        )


def wait_for(happened: Callable[[], bool], what: str) -> None:
    """Raises where it takes longer than anybody would wait."""
    deadline = time.monotonic() + PATIENCE_S
    while not happened():
        assert time.monotonic() < deadline, what
        time.sleep(0.02)


def holder(lock: Path) -> int | None:
    """The process that a stage's lock names."""
    text = lock.read_text() if lock.is_file() else ""
    return int(text) if text else None


def is_alive(process_id: int) -> bool:
    try:
        state = Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"


def kill_in(root: Path, stage: str, after_s: float) -> None:
    """Start the flow and kill it with -9 when `stage` has run for so long."""
    flow, lock = start_flow(root), root / ".lux" / "locks" / stage
    wait_for(lambda: holder(lock) is not None or flow.poll() is not None, stage)
    assert flow.poll() is None, (root / "flow.log").read_text()[-2000:]
    time.sleep(after_s)
    worker = holder(lock)
    assert worker is not None
    assert is_alive(worker), f"{stage} was over before it could be killed"
    os.kill(flow.pid, signal.SIGKILL)
    flow.wait()
    wait_for(lambda: not is_alive(worker), f"{stage} outlived its flow")


def outputs(root: Path) -> dict[str, Any]:
    """Digests of what every stage wrote, but for the report, which shows seconds."""
    stages = yaml.safe_load((root / "dvc.lock").read_text())["stages"]
    return {name: stage["outs"] for name, stage in stages.items() if name not in SKIPPED}


def test_killed_in_every_stage_the_flow_ends_in_the_same_bytes(
    tmp_path: Path, project_root: Path
) -> None:
    quiet = make_copy(project_root, tmp_path / "quiet")
    dvc_repro(quiet)
    killed = make_copy(project_root, tmp_path / "killed")
    for stage in ordered():
        timing = json.loads((quiet / f"artifacts/timings/{stage.name}.json").read_text())
        kill_in(killed, stage.name, timing["wall_s"] / 2)
    last = start_flow(killed)
    assert last.wait(PATIENCE_S) == 0, (killed / "flow.log").read_text()[-2000:]
    assert outputs(killed) == outputs(quiet)
