"""One Prefect server for all schedules of a project, started again when it dies.

Whoever holds a lock beside the database runs the server. The others wait for the lock, so that the
server lives as long as any of them, always at one port: clients go on after a gap of seconds.
"""

from __future__ import annotations

import fcntl
import json
import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from flows.living import bury_dead_runs, dead_runs
from flows.prefect_settings import prefect_home, use_prefect_of
from flows.servers import HOST, START_S, Server, prefect_server, started, wait_until_up
from luxcore.errors import LuxError
from luxcore.files.atomic import write_json
from luxcore.ports import check_port, free_port

LOOK_S = 2.0
"""Seconds between looks at the server and at dead runs."""


def name_server(root: Path) -> Server | None:
    """Name the server to this process and its children through `PREFECT_API_URL`.

    None where the environment names one already, which is taken as it is. To be called before
    Prefect is imported: it keeps the settings of that moment.
    """
    use_prefect_of(root)
    if os.environ.get("PREFECT_API_URL"):
        return None
    server = _server(root)
    os.environ["PREFECT_API_URL"] = f"{server.address}/api"
    return server


@contextmanager
def kept_up(server: Server | None, root: Path) -> Iterator[None]:
    """Have the server answer all through this block."""
    if server is None:
        yield
        return
    stop = threading.Event()
    keeper = threading.Thread(target=_keep, args=(server, root, stop), daemon=True)
    keeper.start()
    try:
        _wait(server, keeper)
        yield
    finally:
        stop.set()
        keeper.join()


def _server(root: Path) -> Server:
    """At the port of last time, unless somebody else took it while no schedule was running."""
    note = prefect_home(root) / "server.json"
    port = _noted_port(note) or free_port(HOST)
    server = prefect_server(root, port, schedules=True)
    if not server.answers():
        try:
            check_port(HOST, port)
        except LuxError:
            server = prefect_server(root, free_port(HOST), schedules=True)
    write_json(note, {"port": server.port})
    return server


def _noted_port(note: Path) -> int | None:
    """None where there is no note, or a damaged one."""
    try:
        return int(json.loads(note.read_text(encoding="utf-8"))["port"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _keep(server: Server, root: Path, stop: threading.Event) -> None:
    with open(prefect_home(root) / "server.lock", "w", encoding="utf-8") as lock:
        while not stop.is_set():
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                stop.wait(LOOK_S)
                continue
            _run_until_it_dies(server, root, stop)


def _run_until_it_dies(server: Server, root: Path, stop: threading.Event) -> None:
    try:
        with started(server, root) as process:
            wait_until_up(server, process, root)
            while process.poll() is None and not stop.wait(LOOK_S):
                if dead_runs(prefect_home(root)):
                    bury_dead_runs(prefect_home(root))
        if not stop.is_set():
            print(f"the Prefect server ended (code {process.returncode}); starting it again.")
    except Exception as error:
        # This thread must outlive whatever one server does; the next one may do better.
        print(f"the Prefect server: {error}", file=sys.stderr)
        stop.wait(LOOK_S)


def _wait(server: Server, keeper: threading.Thread) -> None:
    deadline = time.monotonic() + START_S
    while not server.answers():
        if time.monotonic() > deadline or not keeper.is_alive():
            raise LuxError(f"no Prefect server answers at {server.address}.")
        time.sleep(0.3)
