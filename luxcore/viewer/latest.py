"""Work of which only the newest request matters: a slider in motion must not queue stale frames."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable
from functools import partial
from typing import Generic, TypeVar

Request = TypeVar("Request")


class LatestWins(Generic[Request]):
    """One thread that does the newest request of every key, and drops those it overtook.

    `work(key, request, is_current)` may ask `is_current()` before it shows a result: False once a
    newer request of the same key has come in. Work begins `wait_s` after the newest request of its
    key, so that a hand still moving is not interrupted.
    """

    def __init__(
        self,
        work: Callable[[Hashable, Request, Callable[[], bool]], None],
        report: Callable[[Exception], None],
        wait_s: float = 0.0,
    ) -> None:
        self._work = work
        self._report = report
        self._wait_s = wait_s
        self._changed = threading.Condition()
        self._pending: dict[Hashable, tuple[float, int, Request]] = {}
        """Key → (when it is due, ticket, request)."""
        self._newest: dict[Hashable, int] = {}
        self._count = 0
        self._busy = False
        self._open = True
        self._thread = threading.Thread(target=self._run, daemon=True, name="latest-wins")
        self._thread.start()

    def submit(self, key: Hashable, request: Request) -> None:
        """Ask for work; whatever the key asked for before is dropped."""
        with self._changed:
            self._count += 1
            self._pending[key] = (time.monotonic() + self._wait_s, self._count, request)
            self._newest[key] = self._count
            self._changed.notify_all()

    def cancel(self, key: Hashable) -> None:
        """Drop what the key asked for; work under way finds out through `is_current`."""
        with self._changed:
            self._pending.pop(key, None)
            self._newest.pop(key, None)
            self._changed.notify_all()

    def drain(self, timeout_s: float) -> bool:
        """Wait until nothing is pending or under way; False when that took too long."""
        with self._changed:
            return self._changed.wait_for(lambda: not (self._pending or self._busy), timeout_s)

    def close(self) -> None:
        """Drop everything pending and end the thread."""
        with self._changed:
            self._open = False
            self._pending.clear()
            self._newest.clear()
            self._changed.notify_all()
        self._thread.join(timeout=10)

    def _run(self) -> None:
        while (taken := self._take()) is not None:
            key, ticket, request = taken
            try:
                self._work(key, request, partial(self._is_newest, key, ticket))
            except Exception as error:
                # The thread must outlive one failed frame; the page is told.
                self._report(error)
            with self._changed:
                self._busy = False
                self._changed.notify_all()

    def _is_newest(self, key: Hashable, ticket: int) -> bool:
        return self._newest.get(key) == ticket

    def _take(self) -> tuple[Hashable, int, Request] | None:
        with self._changed:
            while self._open:
                key = min(self._pending, key=lambda k: self._pending[k][:2], default=None)
                if key is None:
                    self._changed.wait()
                    continue
                due, ticket, request = self._pending[key]
                if due <= time.monotonic():
                    del self._pending[key]
                    self._busy = True
                    return key, ticket, request
                self._changed.wait(due - time.monotonic())
            return None
