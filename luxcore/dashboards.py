"""Start the pages of mlflow and Prefect as processes of their own, on loopback only."""

from __future__ import annotations

import http.client
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from luxcore.errors import LuxError
from luxcore.ports import check_port

HOST = "127.0.0.1"
START_S = 180.0
"""A first start creates databases: Prefect takes half a minute of CPU for it."""
STOP_S = 10.0
QUIET = {
    "MLFLOW_DISABLE_TELEMETRY": "true",
    "DO_NOT_TRACK": "true",
    "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
}


@dataclass(frozen=True)
class Dashboard:
    """One server: what it shows, where it answers, how it is started."""

    title: str
    port: int
    health: str
    """Path that answers 200 once the server is up."""
    command: tuple[str, ...]
    environment: dict[str, str]

    @property
    def address(self) -> str:
        return f"http://{HOST}:{self.port}"


def dashboards(root: Path, mlflow_port: int, prefect_port: int) -> tuple[Dashboard, Dashboard]:
    """The two servers over a project's records."""
    store = os.environ.get("MLFLOW_TRACKING_URI", f"sqlite:///{root / 'mlflow.db'}")
    # With more than one worker its supervisor kills workers that need over 5 s to start.
    runs = (sys.executable, "-m", "mlflow", "ui", "--workers", "1", "--backend-store-uri", store)
    flows = (sys.executable, "-m", "prefect", "server", "start", "--no-services")
    at = ("--host", HOST, "--port")
    api = {"PREFECT_API_URL": f"http://{HOST}:{prefect_port}/api"}
    return (
        Dashboard(
            "mlflow: metrics, curves and pictures of every stage",
            mlflow_port, "/health", (*runs, *at, str(mlflow_port)), {},
        ),
        Dashboard(
            "Prefect: flows, retries and reasons",
            prefect_port, "/api/health", (*flows, *at, str(prefect_port)), api,
        ),
    )  # fmt: skip


def serve_dashboards(
    root: Path, mlflow_port: int, prefect_port: int, say: Callable[[str], None]
) -> None:
    """Start both, say their addresses, and wait until one ends or the user interrupts.

    Raises InputError when a port is in use, LuxError when a server does not start or ends.
    """
    pages = dashboards(root, mlflow_port, prefect_port)
    for page in pages:
        check_port(HOST, page.port)
    # Unlike an interrupt, a termination would leave the servers behind.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    logs = root / ".lux"
    logs.mkdir(exist_ok=True)
    with ExitStack() as stack:
        running = [stack.enter_context(_started(page, root, logs)) for page in pages]
        for page, (process, log) in zip(pages, running, strict=True):
            _wait_until_up(page, process, log)
            say(f"{page.title}: {page.address}")
        say("Ctrl-C ends both.")
        while all(process.poll() is None for process, _ in running):
            time.sleep(0.5)
        raise LuxError(f"a dashboard ended by itself; its log is in {logs}.")


@contextmanager
def _started(
    page: Dashboard, root: Path, logs: Path
) -> Iterator[tuple[subprocess.Popen[bytes], Path]]:
    log = logs / f"dashboard-{page.port}.log"
    environment = {**os.environ, **QUIET, **page.environment}
    with open(log, "wb") as stream:
        # A session of its own: both servers start workers, which must end with them.
        process = subprocess.Popen(
            page.command, cwd=root, env=environment, stdout=stream, stderr=stream,
            start_new_session=True,
        )  # fmt: skip
    try:
        yield process, log
    finally:
        _stop(process)


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


def _wait_until_up(page: Dashboard, process: subprocess.Popen[bytes], log: Path) -> None:
    deadline = time.monotonic() + START_S
    while time.monotonic() < deadline and process.poll() is None:
        if _answers(page):
            return
        time.sleep(0.3)
    raise LuxError(f"{page.title.split(':')[0]} did not start; its log is {log}.")


def _answers(page: Dashboard) -> bool:
    # Not urllib: it would ask a proxy of the environment for this machine's own pages.
    connection = http.client.HTTPConnection(HOST, page.port, timeout=2)
    try:
        connection.request("GET", page.health)
        return connection.getresponse().status == 200
    except (OSError, http.client.HTTPException):
        return False
    finally:
        connection.close()
