"""A two-stage DVC project in a temporary folder, driven by the real runner and flow."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from flows.dag import Stage
from flows.dvc_runner import environment

TOY_STAGES = (Stage("rooms", "writes a number"), Stage("render", "doubles it", needs=("rooms",)))

DVC_YAML = """\
stages:
  rooms:
    cmd: exec python first.py
    deps: [first.py]
    params: [seed]
    outs: [artifacts/rooms]
  render:
    cmd: exec python second.py
    deps: [second.py, artifacts/rooms]
    outs: [artifacts/render]
"""
FIRST = """\
import pathlib, yaml
seed = yaml.safe_load(open("params.yaml"))["seed"]
out = pathlib.Path("artifacts/rooms"); out.mkdir(parents=True)
(out / "value").write_text(str(seed + 1))
open("log", "a").write("rooms\\n")
"""
SECOND = """\
import pathlib, sys
value = int(pathlib.Path("artifacts/rooms/value").read_text())
if value > 100:
    sys.exit("lux: the value is too large.")
out = pathlib.Path("artifacts/render"); out.mkdir(parents=True)
(out / "value").write_text(str(2 * value))
open("log", "a").write("render\\n")
"""


def make_project(root: Path, seed: int = 0) -> Path:
    """A git and DVC repository with the two toy stages."""
    root.mkdir(parents=True, exist_ok=True)
    (root / "dvc.yaml").write_text(DVC_YAML)
    (root / "first.py").write_text(FIRST)
    (root / "second.py").write_text(SECOND)
    (root / ".gitignore").write_text("artifacts\nlog\n")
    set_seed(root, seed)
    for command in (["git", "init", "-q"], [sys.executable, "-m", "dvc", "init", "-q"]):
        subprocess.run(command, cwd=root, check=True, env=environment())
    # Otherwise every DVC command starts two more processes, to report and to look for updates.
    (root / ".dvc" / "config").write_text("[core]\nanalytics = false\ncheck_update = false\n")
    return root


def set_seed(root: Path, seed: int) -> None:
    (root / "params.yaml").write_text(f"seed: {seed}\n")


def runs(root: Path) -> list[str]:
    """Which stages really ran, in order."""
    log = root / "log"
    return log.read_text().split() if log.exists() else []


def dvc_repro(root: Path) -> str:
    """Plain `dvc repro`, as a user types it; returns what it printed."""
    done = subprocess.run(
        [sys.executable, "-m", "dvc", "repro"],
        cwd=root,
        env=environment(),
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout
