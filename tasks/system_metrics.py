"""Memory and processor use of a stage with all its processes, sampled while it runs."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass

import psutil

INTERVAL_S = 2.0
PREFIX = "system/"
"""mlflow shows metrics of this name on a page of their own."""


@dataclass(frozen=True)
class Sample:
    """One look at the machine. Times are milliseconds since 1970."""

    time_ms: int
    values: dict[str, float]


class SystemSampler:
    """Samples this process and its children every `INTERVAL_S` within a `with` block."""

    def __init__(self) -> None:
        self.samples: list[Sample] = []
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._last: tuple[float, dict[int, float]] = (time.monotonic(), _cpu_seconds())

    def __enter__(self) -> SystemSampler:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        self.samples.append(self._look())

    def _run(self) -> None:
        while not self._stop.wait(INTERVAL_S):
            self.samples.append(self._look())

    def _look(self) -> Sample:
        now, used = time.monotonic(), _cpu_seconds()
        before, known = self._last
        self._last = (now, used)
        # A child that ended since takes its last share with it; a new one starts from zero.
        busy = sum(seconds - known.get(pid, 0.0) for pid, seconds in used.items())
        values = {
            "process_tree_cpu_cores": max(busy, 0.0) / max(now - before, 1e-3),
            "process_tree_memory_megabytes": _memory_mb(),
            "system_memory_usage_percentage": psutil.virtual_memory().percent,
        }
        return Sample(int(time.time() * 1000), {PREFIX + n: v for n, v in values.items()})


def _tree() -> list[psutil.Process]:
    own = psutil.Process()
    return [own, *own.children(recursive=True)]


def _cpu_seconds() -> dict[int, float]:
    """User and system time by process."""
    used = {}
    for process in _tree():
        try:
            times = process.cpu_times()
        except psutil.Error:
            continue
        used[process.pid] = times.user + times.system
    return used


def _memory_mb() -> float:
    """Resident memory, MB; pages that processes share are counted for each."""
    total = 0
    for process in _tree():
        try:
            total += process.memory_info().rss
        except psutil.Error:
            continue
    return total / 1e6
