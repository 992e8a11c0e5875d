"""The settings of Prefect for a project. Prefect reads them when it is imported, so call first."""

from __future__ import annotations

import os
from pathlib import Path

QUIET = {
    "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
    "DO_NOT_TRACK": "true",
    "MLFLOW_DISABLE_TELEMETRY": "true",
    "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false",
    "PREFECT_SERVER_EPHEMERAL_STARTUP_TIMEOUT_SECONDS": "600",
    "PREFECT_LOGGING_TO_API_WHEN_MISSING_FLOW": "ignore",
}
"""Nothing phones home, and a slow machine is given the time to start a server."""


def prefect_home(root: Path) -> Path:
    """Where a project's Prefect keeps its database: `PREFECT_HOME`, or `.lux/prefect`."""
    return Path(os.environ.get("PREFECT_HOME", root.resolve() / ".lux" / "prefect"))


def prefect_environment(root: Path) -> dict[str, str]:
    """What every process of Prefect for the project at `root` is started with.

    The database is named beside the home: a profile of the user may name another one.
    """
    home = prefect_home(root)
    database = f"sqlite+aiosqlite:///{home / 'prefect.db'}"
    return {
        **QUIET,
        "PREFECT_HOME": str(home),
        "PREFECT_SERVER_DATABASE_CONNECTION_URL": os.environ.get(
            "PREFECT_SERVER_DATABASE_CONNECTION_URL", database
        ),
    }


def use_prefect_of(root: Path) -> None:
    """Point this process's Prefect at the project's database; must precede `import prefect`."""
    for name, value in prefect_environment(root).items():
        os.environ.setdefault(name, value)
    prefect_home(root).mkdir(parents=True, exist_ok=True)
