"""Whether the databases of mlflow and Prefect are whole: a damaged one stops either with pages of
traceback, and Prefect's server is then started again for ten minutes.
"""

from __future__ import annotations

import os
import re
import sqlite3
from contextlib import closing
from pathlib import Path

from flows.prefect_settings import prefect_environment
from luxcore.errors import FormatError
from tasks.tracking import tracking_uri


def check_records(root: Path) -> None:
    """Raises FormatError naming the database that is damaged. Those elsewhere are not looked at."""
    urls = [tracking_uri(root)]
    if not os.environ.get("PREFECT_API_URL"):
        urls.append(prefect_environment(root)["PREFECT_SERVER_DATABASE_CONNECTION_URL"])
    for url in urls:
        found = re.fullmatch(r"sqlite(?:\+\w+)?:///(.+)", url)
        if found and Path(found[1]).is_file():
            _check_database(Path(found[1]))


def _check_database(path: Path) -> None:
    try:
        with closing(
            sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True, timeout=1)
        ) as database:
            (said,) = database.execute("PRAGMA quick_check(1)").fetchone()
    except sqlite3.OperationalError:
        # Somebody is writing to it at this moment: it is in use, so it is whole.
        return
    except sqlite3.DatabaseError as error:
        said = str(error)
    if said != "ok":
        fact = " ".join(said.replace("*", "").split()).rstrip(".")
        raise FormatError(
            f"{path} is damaged ({fact}): move it away, and its records begin anew; "
            "artifacts are not in it."
        )
