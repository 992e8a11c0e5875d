"""Where units run: in this process, in worker processes, or on a Dask cluster.

The choice comes from the environment (`LUX_EXECUTOR=serial|processes|dask`, `LUX_WORKERS=2`,
`LUX_DASK_SCHEDULER=tcp://…`), never from a parameter, so no result can depend on it.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from typing import Any, Protocol, runtime_checkable

from luxcore.errors import InputError
from luxcore.lifetime import die_with_parent

Outcome = tuple[int, Any]
"""Index of the call, and what it returned."""


@runtime_checkable
class Executor(Protocol):
    """Runs `function(*arguments)` for each row and yields outcomes as they finish."""

    def run(
        self, function: Callable[..., Any], rows: Sequence[tuple[Any, ...]]
    ) -> Iterator[Outcome]:
        """Yield (index, result). A worker that dies yields an exception as its result."""


class SerialExecutor:
    """One after the other, in this process."""

    def run(
        self, function: Callable[..., Any], rows: Sequence[tuple[Any, ...]]
    ) -> Iterator[Outcome]:
        for index, row in enumerate(rows):
            yield index, function(*row)


class ProcessExecutor:
    """A pool of spawned processes (fork after a render hangs)."""

    def __init__(self, workers: int) -> None:
        self.workers = workers

    def run(
        self, function: Callable[..., Any], rows: Sequence[tuple[Any, ...]]
    ) -> Iterator[Outcome]:
        pending = dict(enumerate(rows))
        # A killed worker breaks the whole pool; the calls it took along are tried once more,
        # each in a pool of its own, so that the one that kills is named and the others survive.
        with _pool(self.workers) as pool:
            futures = {pool.submit(function, *row): i for i, row in pending.items()}
            for future in as_completed(futures):
                index = futures[future]
                if isinstance(future.exception(), BrokenProcessPool):
                    continue
                pending.pop(index)
                yield index, future.exception() or future.result()
        for index, row in pending.items():
            with _pool(1) as pool:
                future = pool.submit(function, *row)
                yield index, future.exception() or future.result()


def _pool(workers: int) -> ProcessPoolExecutor:
    # Workers hold each other's pipes open, so that they would outlive a killed parent for ever.
    return ProcessPoolExecutor(
        workers,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_begin_worker,
    )


def _begin_worker() -> None:
    die_with_parent()
    # A Ctrl-C reaches every process of the terminal; the stage itself says that it was stopped.
    signal.signal(signal.SIGINT, signal.SIG_DFL)


class DaskExecutor:
    """A Dask cluster; a unit of a lost worker is run again elsewhere by the scheduler."""

    def __init__(self, scheduler: str | None, workers: int) -> None:
        self.scheduler, self.workers = scheduler, workers

    def run(
        self, function: Callable[..., Any], rows: Sequence[tuple[Any, ...]]
    ) -> Iterator[Outcome]:
        from distributed import Client, LocalCluster
        from distributed import as_completed as dask_as_completed

        # Whoever takes the outcomes may stop in the middle: the cluster ends all the same.
        with ExitStack() as stack:
            address = self.scheduler or stack.enter_context(
                LocalCluster(
                    n_workers=self.workers,
                    threads_per_worker=1,
                    host="127.0.0.1",
                    dashboard_address=None,
                )
            )
            client = stack.enter_context(Client(address))
            futures = {client.submit(function, *row, pure=False): i for i, row in enumerate(rows)}
            for future in dask_as_completed(list(futures)):
                yield futures[future], future.exception() or future.result()


def executor_from_environment() -> Executor:
    """The executor that `LUX_EXECUTOR` and `LUX_WORKERS` name; one process per core if unset."""
    kind = os.environ.get("LUX_EXECUTOR", "processes")
    text = os.environ.get("LUX_WORKERS", str(os.cpu_count() or 1))
    if not text.isdigit() or int(text) < 1:
        raise InputError(f"LUX_WORKERS must be a whole number of at least 1, got {text!r}.")
    if kind == "serial":
        return SerialExecutor()
    if kind == "processes":
        return ProcessExecutor(int(text))
    if kind == "dask":
        return DaskExecutor(os.environ.get("LUX_DASK_SCHEDULER"), int(text))
    raise InputError(f"LUX_EXECUTOR must be serial, processes or dask, got {kind!r}.")
