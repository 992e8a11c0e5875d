"""Progress bars with rate and time left; plain lines where no terminal is attached."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol, runtime_checkable

LINE_EVERY_S = 10.0
"""Seconds between plain lines when the output is a file: enough to see life, no flood."""


@runtime_checkable
class Bar(Protocol):
    """What a long computation reports to."""

    def advance(self, steps: int = 1, **facts: object) -> None:
        """`steps` more are done; `facts` (psnr="27.1") are shown beside the bar."""


class _Silent:
    def advance(self, steps: int = 1, **facts: object) -> None:
        pass


class _Lines:
    """For logs: one line every `LINE_EVERY_S`, and one at the end."""

    def __init__(self, label: str, total: int, unit: str) -> None:
        self.label, self.total, self.unit = label, total, unit
        self.done, self.start, self.last = 0, time.monotonic(), 0.0
        self.facts: dict[str, object] = {}

    def advance(self, steps: int = 1, **facts: object) -> None:
        self.done += steps
        self.facts.update(facts)
        now = time.monotonic()
        finished = self.done >= self.total
        if finished or (now - self.start > 2 and now - self.last > LINE_EVERY_S):
            self.last = now
            print(self._line(now - self.start), file=sys.stderr, flush=True)

    def _line(self, elapsed: float) -> str:
        rate = self.done / max(elapsed, 1e-9)
        left = (self.total - self.done) / max(rate, 1e-9)
        facts = "".join(f"  {k} {v}" for k, v in self.facts.items())
        return (
            f"{self.label}: {self.done}/{self.total} {self.unit}  "
            f"{rate:.1f} {self.unit}/s  {left:.0f} s left{facts}"
        )


class _Rich:
    def __init__(self, bars: object, task: object) -> None:
        self._bars, self._task = bars, task

    def advance(self, steps: int = 1, **facts: object) -> None:
        text = "  ".join(f"{k} {v}" for k, v in facts.items())
        update = {"facts": text} if facts else {}
        self._bars.update(self._task, advance=steps, **update)  # type: ignore[attr-defined]


@contextmanager
def progress(label: str, total: int, unit: str = "it", *, quiet: bool = False) -> Iterator[Bar]:
    """A bar over `total` steps on standard error."""
    if quiet:
        yield _Silent()
    elif not sys.stderr.isatty():
        yield _Lines(label, total, unit)
    else:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
        from rich.progress import TimeRemainingColumn as TimeLeft

        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.speed:.1f} " + unit + "/s"),
            TimeLeft(),
            TextColumn("{task.fields[facts]}"),
        )
        with Progress(*columns, console=Console(stderr=True)) as bars:
            yield _Rich(bars, bars.add_task(label, total=total, facts="", speed=0.0))
