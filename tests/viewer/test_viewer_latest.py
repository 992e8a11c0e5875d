"""Only the newest request is worth doing."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable

from luxcore.viewer.latest import LatestWins


class Recorder:
    """Work that waits until it is let go, and remembers what it did."""

    def __init__(self) -> None:
        self.done: list[tuple[Hashable, int]] = []
        self.shown: list[int] = []
        self.begun = threading.Event()
        self.go = threading.Event()

    def __call__(self, key: Hashable, request: int, is_current: Callable[[], bool]) -> None:
        self.begun.set()
        assert self.go.wait(10)
        if request < 0:
            raise ValueError("bad frame")
        self.done.append((key, request))
        if is_current():
            self.shown.append(request)


def test_overtaken_requests_are_dropped_and_stale_results_not_shown() -> None:
    work, errors = Recorder(), []
    queue = LatestWins(work, errors.append)
    queue.submit("a", 1)
    assert work.begun.wait(10)
    for request in range(2, 100):
        queue.submit("a", request)
    work.go.set()
    assert queue.drain(10.0)
    assert work.done == [("a", 1), ("a", 99)]
    assert work.shown == [99]
    queue.close()


def test_keys_do_not_overtake_each_other() -> None:
    work, errors = Recorder(), []
    queue = LatestWins(work, errors.append)
    work.go.set()
    for key in "abc":
        queue.submit(key, ord(key))
    assert queue.drain(10.0)
    assert sorted(work.done) == [("a", 97), ("b", 98), ("c", 99)]
    queue.close()


def test_one_failed_frame_is_reported_and_the_next_one_drawn() -> None:
    work, errors = Recorder(), []
    queue = LatestWins(work, errors.append)
    work.go.set()
    queue.submit("a", -1)
    assert queue.drain(10.0)
    queue.submit("a", 5)
    assert queue.drain(10.0)
    assert work.shown == [5]
    assert [str(e) for e in errors] == ["bad frame"]
    queue.close()


def test_cancelled_work_never_begins() -> None:
    work, errors = Recorder(), []
    queue = LatestWins(work, errors.append, wait_s=0.2)
    work.go.set()
    queue.submit("a", 1)
    queue.cancel("a")
    assert queue.drain(10.0)
    assert work.done == []
    queue.close()
