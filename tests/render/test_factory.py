"""Many machines: a scheduler and workers as processes of their own, one of them killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from luxcore.files.digests import array_digest
from luxcore.files.exr import read_exr
from luxcore.render.dataset import Job, panorama_jobs, run_jobs
from luxcore.rooms import generate_room
from luxcore.settings.render import RenderSettings
from luxcore.settings.rooms import RoomsSettings
from luxcore.units import UnitStore, executor_from_environment, read_seconds
from luxcore.units.executor import SerialExecutor

pytestmark = [pytest.mark.slow, pytest.mark.blender]

TINY = RenderSettings(height=32, spp=2)
ROOMS, WORKERS = 6, 3
PATIENCE_S = 300.0


def start(module: str, folder: Path, *arguments: str) -> subprocess.Popen[bytes]:
    """A process of Dask's command line that talks on the loopback interface only."""
    shared = ["--scheduler-file", str(folder / "scheduler.json"), "--host", "127.0.0.1"]
    with open(folder / "dask.log", "ab") as log:
        run = [sys.executable, "-m", f"distributed.cli.{module}", *shared, "--no-dashboard"]
        return subprocess.Popen([*run, *arguments], stdout=log, stderr=log, cwd=Path.cwd())


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[str]:
    """The address of a scheduler with three workers, each one thread, without nannies."""
    from distributed import Client

    (tmp_path / "dask").mkdir()
    folder = tmp_path / "dask"
    processes = [start("dask_scheduler", folder, "--port", "0")]
    alone = ("--nthreads", "1", "--no-nanny", "--local-directory", str(folder))
    try:
        processes += [start("dask_worker", folder, *alone) for _ in range(WORKERS)]
        wait_for(lambda: (folder / "scheduler.json").is_file())
        with Client(scheduler_file=str(folder / "scheduler.json")) as client:
            client.wait_for_workers(WORKERS, timeout=PATIENCE_S)
            address = str(client.scheduler.address)
        yield address
    finally:
        for process in processes:
            process.kill()
            process.wait()


def wait_for(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.02)


def kill_a_busy_worker(address: str, store: UnitStore, jobs: list[Job], killed: list[int]) -> None:
    """kill -9 for a worker that renders, once the first view is done and others are not."""
    from distributed import Client

    wait_for(lambda: any(store.has(job.unit.key) for job in jobs))
    with Client(address) as client:
        busy = next(name for name, tasks in client.processing().items() if tasks)
        pid = client.run(os.getpid, workers=[busy])[busy]
        os.kill(pid, signal.SIGKILL)
        killed.append(pid)


def digests(folder: Path) -> dict[str, str]:
    """Of every layer of every view."""
    return {
        f"{file.relative_to(folder)}:{name}": array_digest(pixels)
        for file in sorted(folder.rglob("*.exr"))
        for name, pixels in read_exr(file).items()
    }


def test_a_killed_worker_changes_nothing(
    tmp_path: Path, cluster: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    rooms = [generate_room(seed, RoomsSettings()) for seed in range(40, 40 + ROOMS)]
    jobs = panorama_jobs(rooms, TINY, "train")
    store, killed = UnitStore(tmp_path / "units"), list[int]()
    killer = threading.Thread(target=kill_a_busy_worker, args=(cluster, store, jobs, killed))
    monkeypatch.setenv("LUX_EXECUTOR", "dask")
    monkeypatch.setenv("LUX_DASK_SCHEDULER", cluster)
    killer.start()
    failed = run_jobs(jobs, tmp_path / "many", TINY, store, executor_from_environment())
    killer.join(PATIENCE_S)
    assert len(killed) == 1
    assert failed == {}
    assert set(read_seconds(store)) == {job.unit.name for job in jobs}
    alone = UnitStore(tmp_path / "alone")
    assert run_jobs(jobs, tmp_path / "one", TINY, alone, SerialExecutor()) == {}
    assert digests(tmp_path / "many") == digests(tmp_path / "one")
    assert len({name.split(":")[0] for name in digests(tmp_path / "one")}) == 3 * ROOMS
    # What the killed worker had half written is gone.
    assert not list(store.root.glob("*/.*"))
