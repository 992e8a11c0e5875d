"""The Prefect server of one `lux run`, where the environment names none.

Prefect would start one by itself, in our process group: a Ctrl-C would end it before the run, which
then tries for a minute to report its end. One that is killed would leave its server behind.
"""

from __future__ import annotations

import atexit
import logging
import os
import sys
from contextlib import ExitStack
from pathlib import Path

from flows.prefect_settings import prefect_environment, use_prefect_of
from flows.servers import HOST, Server, log_of, started, wait_until_up
from luxcore.ports import free_port

# What Prefect sets for its own temporary server: no pages, and no services that plan runs.
_TEMPORARY = {
    "PREFECT_UI_ENABLED": "0",
    "PREFECT__SERVER_EPHEMERAL": "1",
    "PREFECT__SERVER_FINAL": "1",
}


def start_own_server(root: Path) -> None:
    """Start a server over the project's database; it ends with this process.

    To be called before Prefect is imported, which keeps the settings of that moment. Raises
    LuxError naming the server's log when it does not start.
    """
    use_prefect_of(root)
    if os.environ.get("PREFECT_API_URL"):
        return
    server = _server(root, free_port(HOST))
    stack = ExitStack()
    # As the last thing of all: Prefect's threads send what they hold when the interpreter ends.
    atexit.register(stack.close)
    process = stack.enter_context(started(server, root))
    wait_until_up(server, process, root)
    stack.callback(log_of(server, root).unlink, missing_ok=True)
    os.environ["PREFECT_API_URL"] = f"{server.address}/api"
    logging.getLogger("prefect.flow_runs").addFilter(_leads_somewhere)


def _leads_somewhere(record: logging.LogRecord) -> bool:
    # Prefect's link to the run: this server has no pages.
    return not record.getMessage().startswith("View at ")


def _server(root: Path, port: int) -> Server:
    command = [sys.executable, "-m", "uvicorn", "--factory", "prefect.server.api.server:create_app"]
    command += ["--host", HOST, "--port", str(port), "--log-level", "error", "--lifespan", "on"]
    environment = {**prefect_environment(root), **_TEMPORARY}
    return Server("Prefect: of one run", port, "/api/health", tuple(command), environment)
