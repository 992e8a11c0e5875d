"""mlflow's and Prefect's pages and the report, on loopback, over the records of a project."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from flows.living import bury_dead_runs, dead_runs
from flows.prefect_settings import prefect_home, use_prefect_of
from flows.servers import (
    HOST,
    Server,
    log_of,
    mlflow_server,
    prefect_server,
    report_server,
    started,
    wait_until_up,
)
from luxcore.errors import InputError, LuxError
from luxcore.ports import check_port

MLFLOW_PORT, PREFECT_PORT, REPORT_PORT = 5000, 4200, 4300


def dashboards(
    root: Path, mlflow_port: int, prefect_port: int, report_port: int
) -> tuple[Server, ...]:
    """The servers over a project's records; the report's only where there is one."""
    pages = (
        mlflow_server(root, mlflow_port),
        prefect_server(root, prefect_port, schedules=False),
    )
    if not (root / "reports" / "index.html").is_file():
        return pages
    return (*pages, report_server(root, report_port))


def serve_dashboards(root: Path, pages: tuple[Server, ...], say: Callable[[str], None]) -> None:
    """Start all, say their addresses, and wait until one ends or the user interrupts.

    Raises InputError when a port is in use or given twice, LuxError when a server does not start
    or ends.
    """
    for number, page in enumerate(pages):
        check_port(HOST, page.port)
        for other in pages[:number]:
            if other.port == page.port:
                raise InputError(f"port {page.port} is asked for by {other.name} and {page.name}.")
    # Unlike an interrupt, a termination would leave the servers behind.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with ExitStack() as stack:
        running = [(page, stack.enter_context(started(page, root))) for page in pages]
        for page, process in running:
            wait_until_up(page, process, root)
            say(f"{page.title}: {page.address}")
        say("Ctrl-C ends all of them.")
        _watch(root, running)


def _watch(root: Path, running: list[tuple[Server, subprocess.Popen[bytes]]]) -> None:
    """While they run, mark flow runs that a kill left "Running", so that no page shows them so."""
    while True:
        for page, process in running:
            if process.poll() is not None:
                raise LuxError(f"{page.name} ended by itself; its log is {log_of(page, root)}.")
            if page.name == "Prefect" and dead_runs(prefect_home(root)):
                use_prefect_of(root)
                os.environ["PREFECT_API_URL"] = f"{page.address}/api"
                bury_dead_runs(prefect_home(root))
        time.sleep(0.5)
