"""Records that are damaged are named, and what is only a record or a forecast stops nothing."""

from __future__ import annotations

import errno
import os
import sqlite3
from pathlib import Path

import numpy as np
import pytest

import tasks.__main__ as stage_command
from flows.digests import stage_digests
from flows.living import FOLDER, bury_dead_runs
from flows.plan import _last_seconds
from flows.prefect_settings import prefect_home
from flows.records import check_records
from flows.summary import metrics_table
from luxcore.errors import FormatError, LuxError
from luxcore.settings.project import ProjectSettings
from luxcore.units.store import seal_folder
from tasks import report
from tasks.context import StageContext


@pytest.fixture
def databases(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """mlflow's and Prefect's, whole, with some pages of content."""
    for name in ("PREFECT_HOME", "PREFECT_API_URL", "MLFLOW_TRACKING_URI"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.delenv("PREFECT_SERVER_DATABASE_CONNECTION_URL", raising=False)
    prefect_home(tmp_path).mkdir(parents=True)
    paths = [tmp_path / "mlflow.db", prefect_home(tmp_path) / "prefect.db"]
    for path in paths:
        with sqlite3.connect(path) as database:
            database.execute("create table runs (name text)")
            database.executemany("insert into runs values (?)", [("x" * 900,)] * 200)
    return paths


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize("size", [50, 5000, 100_000])
def test_a_truncated_database_is_named_and_kept(
    tmp_path: Path, databases: list[Path], which: int, size: int
) -> None:
    check_records(tmp_path)
    os.truncate(databases[which], size)
    with pytest.raises(FormatError, match=f"^{databases[which]} is damaged .*begin anew"):
        check_records(tmp_path)
    assert databases[which].stat().st_size == size


def test_a_database_that_is_new_or_in_use_is_no_damage(
    tmp_path: Path, databases: list[Path]
) -> None:
    databases[0].write_bytes(b"")
    writer = sqlite3.connect(databases[1])
    writer.execute("begin exclusive")
    check_records(tmp_path)
    writer.close()


def test_a_note_that_was_half_written_is_no_obstacle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("flows.living._mark_in_prefect", lambda run_id: None)
    note = tmp_path / FOLDER / "00000000-0000-0000-0000-000000000001.json"
    note.parent.mkdir()
    note.write_text('{"tracking_uri": "sqli')
    assert bury_dead_runs(tmp_path) == []
    assert not note.exists()


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"wall_s": "long"}', '{"wall_s": null}'])
def test_a_damaged_timing_is_not_known_and_stops_no_plan(tmp_path: Path, text: str) -> None:
    timings = tmp_path / "artifacts" / "timings"
    timings.mkdir(parents=True)
    (timings / "rooms.json").write_text(text)
    assert _last_seconds(tmp_path, "rooms") is None
    (timings / "rooms.json").write_text('{"wall_s": 3}')
    assert _last_seconds(tmp_path, "rooms") == 3.0


def test_digests_name_a_picture_that_cannot_be_read(tmp_path: Path) -> None:
    folder = tmp_path / "artifacts" / "rooms"
    folder.mkdir(parents=True)
    (folder / "x.png").write_text("no picture")
    with pytest.raises(FormatError, match=r"x\.png is not a readable PNG"):
        stage_digests(tmp_path)


def test_scores_that_are_damaged_are_named(tmp_path: Path) -> None:
    scores = tmp_path / "artifacts" / "metrics" / "evaluate.json"
    scores.parent.mkdir(parents=True)
    scores.write_text("{")
    with pytest.raises(FormatError, match=r"evaluate\.json is not readable JSON"):
        metrics_table(tmp_path)


def test_the_report_never_shows_what_a_stage_did_not_write(tmp_path: Path) -> None:
    folder = tmp_path / "artifacts" / "fuse" / "demo"
    folder.mkdir(parents=True)
    np.save(folder / "values.npy", np.zeros(3))
    seal_folder(folder.parent)
    (folder / "values.npy").write_bytes(b"damaged")
    with pytest.raises(LuxError, match=r"values\.npy is not what stage fuse wrote"):
        report.run(StageContext("report", ProjectSettings(), tmp_path))


@pytest.mark.parametrize(
    ("error", "said", "code"),
    [
        (
            OSError(errno.EROFS, "Read-only file system", "a.exr"),
            "a.exr: Read-only file system.",
            1,
        ),
        (OSError(errno.ENOSPC, "No space left on device"), "No space left on device: make room", 1),
        (KeyboardInterrupt(), "stopped.", 130),
    ],
)
def test_a_stage_that_cannot_go_on_says_so_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys, error: BaseException, said: str, code: int
) -> None:
    def fail(*arguments: object) -> None:
        raise error

    monkeypatch.setattr(stage_command, "die_with_parent", lambda: None)
    monkeypatch.setattr(stage_command, "run_stage", fail)
    assert stage_command.main(["rooms"]) == code
    printed = capsys.readouterr().err
    assert printed.startswith(f"lux: {said}")
    assert printed.count("\n") == 1
