"""The unit store and its runner: whole or absent, resumable, the same bytes everywhere."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections import namedtuple
from pathlib import Path

import pytest

from luxcore.errors import InputError, LuxError
from luxcore.units import (
    Unit,
    UnitStore,
    executor_from_environment,
    read_seconds,
    run_units,
    unit_key,
)
from luxcore.units.executor import DaskExecutor, ProcessExecutor, SerialExecutor
from luxcore.units.guard import Limits

WORK = "tests.units.work"


def units_of(function: str, seeds: range, **more: object) -> list[Unit]:
    return [
        Unit(f"seed {s}", f"{WORK}:{function}", a := {"seed": s, **more}, unit_key([], a))
        for s in seeds
    ]


def contents(folders: dict[str, Path]) -> dict[str, bytes]:
    return {name: (folder / "numbers.bin").read_bytes() for name, folder in folders.items()}


@pytest.mark.parametrize(
    "executor",
    [ProcessExecutor(1), ProcessExecutor(2), DaskExecutor(None, 2)],
    ids=["one process", "two processes", "dask"],
)
def test_every_executor_gives_the_bytes_of_the_serial_one(tmp_path, executor):
    units = units_of("draw", range(6))
    serial = run_units(units, UnitStore(tmp_path / "a"), SerialExecutor())
    other = run_units(units, UnitStore(tmp_path / "b"), executor)
    assert contents(other.folders) == contents(serial.folders)


@pytest.mark.parametrize("broken", [False, True], ids=["stopped", "failed"])
def test_a_dask_cluster_ends_with_a_run_that_is_left_early(monkeypatch, broken):
    import distributed

    clusters = []

    class Recorded(distributed.LocalCluster):
        def __init__(self, **options: object) -> None:
            super().__init__(**options)
            clusters.append(self)

    monkeypatch.setattr(distributed, "LocalCluster", Recorded)
    if broken:
        monkeypatch.setattr(distributed, "as_completed", lambda _: 1 / 0)
    outcomes = DaskExecutor(None, 1).run(abs, [(-1,), (-2,)])
    if broken:
        with pytest.raises(ZeroDivisionError):
            next(outcomes)
    else:
        assert next(outcomes) in [(0, 1), (1, 2)]
        outcomes.close()
    assert [cluster.status for cluster in clusters] == [distributed.Status.closed]


def test_finished_units_are_taken_and_a_flipped_bit_costs_one(tmp_path):
    store, units = UnitStore(tmp_path), units_of("draw", range(5))
    first = run_units(units, store)
    broken = first.folders["seed 2"] / "numbers.bin"
    original = broken.read_bytes()
    broken.write_bytes(bytes([original[0] ^ 1]) + original[1:])
    again = run_units(units, store)
    assert (first.reused, again.reused) == (0, 4)
    assert broken.read_bytes() == original


def test_one_poisoned_unit_is_named_and_the_rest_kept(tmp_path):
    store, units = UnitStore(tmp_path), units_of("draw_unless_poisoned", range(6))
    with pytest.raises(LuxError, match=r"1 of 6 rooms failed: seed 3: the lamp has no bulb"):
        run_units(units, store, ProcessExecutor(2), label="rooms")
    assert sum(store.has(u.key) for u in units) == 5
    assert "no bulb" in (tmp_path / "quarantine.jsonl").read_text()
    tolerant = run_units(units, store, label="rooms", max_failed_ratio=0.2)
    assert tolerant.reused == 5
    assert list(tolerant.failed) == ["seed 3"]


def test_a_unit_whose_process_is_killed_does_not_take_the_others_along(tmp_path):
    victim = Unit("victim", f"{WORK}:die", {}, unit_key([], {"die": True}))
    units = [*units_of("draw", range(4)), victim]
    result = run_units(units, UnitStore(tmp_path), ProcessExecutor(2), max_failed_ratio=0.5)
    assert sorted(result.failed) == ["victim"]
    assert len(result.folders) == 4
    assert not list(tmp_path.glob("*/.*"))


def test_time_out_and_memory_cap_are_said_and_leave_nothing(tmp_path):
    slow = Unit("slow", f"{WORK}:sleep", {"seconds": 60}, "slow0")
    hungry = Unit("hungry", f"{WORK}:eat_memory", {"megabytes": 8000}, "hungry0")
    limits = Limits(timeout_s=5.0, memory_mb=4000)
    result = run_units([slow, hungry], UnitStore(tmp_path), limits=limits, max_failed_ratio=1.0)
    assert "took longer than 5 s" in result.failed["slow"]
    assert "needed more than 4000 MB" in result.failed["hungry"]
    assert not list(tmp_path.rglob("started"))


def test_a_disk_that_runs_short_stops_the_run_and_keeps_what_is_done(tmp_path, monkeypatch):
    free = iter([900, 900, 100, 100, 100])
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage(1000, 0, next(free)))
    units, store = units_of("draw", range(5)), UnitStore(tmp_path)
    with pytest.raises(LuxError, match=r"stopped before 3 of 5 rooms; make room"):
        run_units(units, store, label="rooms", max_failed_ratio=1.0, spare_bytes=500)
    assert [store.has(u.key) for u in units] == [True, True, False, False, False]
    # Nothing is wrong with those that were not begun.
    assert not (tmp_path / "quarantine.jsonl").exists()
    monkeypatch.undo()
    assert run_units(units, store).reused == 2


def test_a_killed_run_resumes_with_what_is_missing(tmp_path):
    """kill -9 in the middle: finished units stay, no temporary is taken for a unit."""
    log, root = tmp_path / "log", tmp_path / "units"
    script = (
        "from pathlib import Path; from tests.units.test_units import units_of;"
        "from luxcore.units import UnitStore, run_units;"
        f"run_units(units_of('draw_slowly', range(40), log={str(log)!r}),"
        f"UnitStore(Path({str(root)!r})))"
    )
    process = subprocess.Popen([sys.executable, "-c", script])
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and (not log.exists() or len(log.read_text()) < 20):
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    units, store = units_of("draw_slowly", range(40), log=str(log)), UnitStore(root)
    kept = sum(store.has(u.key) for u in units)
    assert 0 < kept < 40
    result = run_units(units, store)
    assert result.reused == kept
    assert not list(root.glob("*/.*"))
    unbroken = run_units(units_of("draw", range(40)), UnitStore(tmp_path / "unbroken"))
    assert contents(result.folders) == contents(unbroken.folders)


@pytest.mark.parametrize("limits", [None, Limits(timeout_s=60.0)], ids=["free", "guarded"])
def test_what_a_unit_cost_is_kept_beside_it_and_never_in_it(tmp_path, limits):
    units, store = units_of("draw_and_tell", range(2)), UnitStore(tmp_path)
    assert read_seconds(store) == {}
    result = run_units(units, store, limits=limits)
    with open(tmp_path / "seconds.jsonl", "a") as log:
        log.write('{"key": "half a li')
    seconds = read_seconds(store)
    assert {k: v["render"] for k, v in seconds.items()} == {"seed 0": 0.0, "seed 1": 1.0}
    names = {f.name for folder in result.folders.values() for f in folder.iterdir()}
    assert names == {"numbers.bin", "manifest.json"}
    # Units that were found done cost nothing new.
    assert run_units(units, store).reused == 2
    assert read_seconds(store) == seconds


def test_the_key_follows_code_arguments_and_inputs():
    base = unit_key(["luxcore/units"], {"a": 1}, ["x"])
    assert unit_key(["luxcore/units"], {"a": 1}, ["x"]) == base
    assert unit_key(["luxcore/files"], {"a": 1}, ["x"]) != base
    assert unit_key(["luxcore/units"], {"a": 2}, ["x"]) != base
    assert unit_key(["luxcore/units"], {"a": 1}, ["y"]) != base


@pytest.mark.parametrize(
    ("name", "value"), [("LUX_EXECUTOR", "cluster"), ("LUX_WORKERS", "0"), ("LUX_WORKERS", "two")]
)
def test_a_wrong_executor_is_one_sentence(monkeypatch, name, value):
    monkeypatch.setenv(name, value)
    with pytest.raises(InputError, match=name):
        executor_from_environment()


INTERRUPTED = """
from pathlib import Path
import sys
from luxcore.units import Unit, UnitStore, run_units
from luxcore.units.executor import ProcessExecutor
from luxcore.units.guard import Limits
if __name__ == "__main__":
    units = [Unit(str(i), "tests.units.work:sleep", {"seconds": 300}, f"k{i}") for i in range(2)]
    try:
        run_units(units, UnitStore(Path(sys.argv[1])), ProcessExecutor(2), limits=Limits(300.0))
    except KeyboardInterrupt:
        print("stopped", flush=True)
"""


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_an_interrupt_ends_every_process_of_the_units_without_a_word(tmp_path, project_root, how):
    """A Ctrl-C reaches all of them; a kill reaches one, and the others must follow it."""
    script = tmp_path / "script.py"
    script.write_text(INTERRUPTED)
    process = subprocess.Popen(
        [sys.executable, str(script), str(tmp_path / "store")],
        env={**os.environ, "PYTHONPATH": str(project_root)},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    assert _eventually(lambda: len(list(tmp_path.rglob("started"))) == 2)
    if how is signal.SIGINT:
        os.killpg(process.pid, how)
    else:
        process.kill()
    # Their ends of the pipes are open as long as any of them lives.
    said, complaints = process.communicate(timeout=60)
    assert said == ("stopped\n" if how is signal.SIGINT else "")
    assert "Traceback" not in complaints


def _eventually(condition) -> bool:
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        if condition():
            return True
        time.sleep(0.1)
    return False
