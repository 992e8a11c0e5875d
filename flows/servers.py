"""The servers of a project: what each shows, how it is started, and how it ends with us."""

from __future__ import annotations

import http.client
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from flows.prefect_settings import QUIET, prefect_environment
from luxcore.errors import LuxError
from luxcore.lifetime import die_with_parent
from tasks.tracking import tracking_uri

HOST = "127.0.0.1"
START_S = 600.0
"""A first start creates databases: half a minute of CPU, many minutes on a machine that is busy."""
STOP_S = 10.0


@dataclass(frozen=True)
class Server:
    """One server on loopback."""

    title: str
    """Its name, a colon, and what it shows."""
    port: int
    health: str
    """Path that answers 200 once the server is up."""
    command: tuple[str, ...]
    environment: dict[str, str]

    @property
    def address(self) -> str:
        return f"http://{HOST}:{self.port}"

    @property
    def name(self) -> str:
        return self.title.split(":")[0]

    def answers(self) -> bool:
        """Whether it is up."""
        # Not urllib: it would ask a proxy of the environment for this machine's own pages.
        connection = http.client.HTTPConnection(HOST, self.port, timeout=2)
        try:
            connection.request("GET", self.health)
            return connection.getresponse().status == 200
        except (OSError, http.client.HTTPException):
            return False
        finally:
            connection.close()


def mlflow_server(root: Path, port: int) -> Server:
    """mlflow's pages over the project's records."""
    # With more than one worker its supervisor kills workers that need over 5 s to start.
    command = (sys.executable, "-m", "mlflow", "ui", "--workers", "1", "--host", HOST)
    store = ("--port", str(port), "--backend-store-uri", tracking_uri(root))
    title = "mlflow: metrics, curves and pictures of every stage"
    return Server(title, port, "/health", (*command, *store), QUIET)


def prefect_server(root: Path, port: int, *, schedules: bool) -> Server:
    """Prefect's server over the project's database; only with `schedules` does it plan runs."""
    command = [sys.executable, "-m", "prefect", "server", "start", "--host", HOST]
    command += ["--port", str(port)] + ([] if schedules else ["--no-services"])
    api = {"PREFECT_API_URL": f"http://{HOST}:{port}/api"}
    title = "Prefect: flows, retries and reasons"
    return Server(title, port, "/api/health", tuple(command), {**prefect_environment(root), **api})


def report_server(root: Path, port: int) -> Server:
    """The report, for links from pages that browsers forbid to open files."""
    command = (sys.executable, "-m", "http.server", "--bind", HOST, "--directory")
    return Server(
        "report: what went in and what came out",
        port, "/index.html", (*command, str(root / "reports"), str(port)), {},
    )  # fmt: skip


@contextmanager
def started(server: Server, root: Path) -> Iterator[subprocess.Popen[bytes]]:
    """The server as a process that ends with this block, or with this process.

    It may not answer yet: see `wait_until_up`.
    """
    log = log_of(server, root)
    log.parent.mkdir(parents=True, exist_ok=True)
    with open(log, "wb") as stream:
        # A session of its own: servers start workers, which must end with them.
        process = subprocess.Popen(
            server.command, cwd=root, env={**os.environ, **server.environment},
            stdout=stream, stderr=stream, start_new_session=True, preexec_fn=die_with_parent,
        )  # fmt: skip
    try:
        yield process
    finally:
        _stop(process)


def log_of(server: Server, root: Path) -> Path:
    """Where a server's own words go."""
    return root / ".lux" / f"{server.name.lower()}-{server.port}.log"


def wait_until_up(server: Server, process: subprocess.Popen[bytes], root: Path) -> None:
    """Raises LuxError, naming the log, when it ends or does not answer within `START_S`."""
    deadline = time.monotonic() + START_S
    while time.monotonic() < deadline and process.poll() is None:
        if server.answers():
            return
        time.sleep(0.3)
    raise LuxError(f"{server.name} did not start; its log is {log_of(server, root)}.")


def _stop(process: subprocess.Popen[bytes]) -> None:
    # The second signal is for workers that outlived the server.
    for kind in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, kind)
            process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            continue
        except ProcessLookupError:
            return
