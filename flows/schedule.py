"""Runs on a cron schedule: own git worktree, shared cache and units, one at a time."""

from __future__ import annotations

import os
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

from luxcore.errors import LuxError
from luxcore.ports import free_port
from tasks.process import die_with_parent

HOST = "127.0.0.1"
SERVER_START_S = 120


def serve(root: Path, cron: str, stages: list[str] | None, worktree: Path | None) -> None:
    """Serve the scheduled flow until interrupted. Starts a Prefect server where none is named."""
    place = (worktree or root.parent / f"{root.name}-scheduled").resolve()
    prepare_worktree(root, place)
    server = None if os.environ.get("PREFECT_API_URL") else start_server(root)
    try:
        from flows.scheduled import scheduled_run

        print(f"runs at {cron!r} in {place}; pages at {os.environ['PREFECT_API_URL']}")
        parameters = {"root": str(root), "worktree": str(place), "stages": stages}
        scheduled_run.serve(name="scheduled", cron=cron, parameters=parameters)
    finally:
        if server is not None:
            server.terminate()


def prepare_worktree(root: Path, place: Path) -> None:
    """A detached worktree at the project's present commit, using the project's DVC cache."""
    revision = _git(root, "rev-parse", "HEAD")
    if (place / ".git").exists():
        _git(place, "checkout", "--quiet", "--detach", revision)
    else:
        _git(root, "worktree", "prune")
        _git(root, "worktree", "add", "--quiet", "--detach", str(place), revision)
    local = place / ".dvc" / "config.local"
    local.write_text(f"[cache]\n    dir = {root / '.dvc' / 'cache'}\n", encoding="utf-8")


def run_in_worktree(root: Path, worktree: Path, stages: list[str] | None) -> str:
    """Bring the worktree's artifacts up to date with the project's present commit."""
    from flows.pipeline import pipeline

    prepare_worktree(root, worktree)
    os.environ["LUX_UNITS"] = str(root / ".lux" / "units")
    done = pipeline(stages, str(worktree))
    return f"{len(done)} stages are up to date in {worktree}."


def start_server(root: Path) -> subprocess.Popen[bytes]:
    """A Prefect server on loopback, named to this process through `PREFECT_API_URL`."""
    port = free_port(HOST)
    os.environ.setdefault("PREFECT_HOME", str(root / ".lux" / "prefect"))
    command = [sys.executable, "-m", "prefect", "server", "start", "--host", HOST]
    log = root / ".lux" / "prefect-server.log"
    log.parent.mkdir(parents=True, exist_ok=True)
    with open(log, "ab") as stream:
        server = subprocess.Popen(
            [*command, "--port", str(port)],
            stdout=stream,
            stderr=stream,
            preexec_fn=die_with_parent,
        )
    url = f"http://{HOST}:{port}/api"
    _wait_for(f"{url}/health", server, log)
    os.environ["PREFECT_API_URL"] = url
    return server


def _wait_for(url: str, server: subprocess.Popen[bytes], log: Path) -> None:
    deadline = time.monotonic() + SERVER_START_S
    while time.monotonic() < deadline and server.poll() is None:
        try:
            with urllib.request.urlopen(url, timeout=2):
                return
        except OSError:
            time.sleep(0.5)
    server.terminate()
    raise LuxError(f"the Prefect server did not start; its log is {log}.")


def _git(folder: Path, *arguments: str) -> str:
    command = ["git", "-C", str(folder), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise LuxError(f"git {arguments[0]} in {folder} failed: {done.stderr.strip()}")
    return done.stdout.strip()
