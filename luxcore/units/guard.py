"""Time-out and memory cap for one unit, which then runs in a process of its own."""

from __future__ import annotations

import importlib
import multiprocessing
import resource
import signal
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from luxcore.errors import LuxError
from luxcore.lifetime import die_with_parent


@dataclass(frozen=True)
class Limits:
    """Bounds for one unit; None means no bound."""

    timeout_s: float | None = None
    memory_mb: int | None = None
    """Address space of the unit's process, in MB."""


def run_guarded(
    function: str, out_dir: Path, arguments: dict[str, Any], limits: Limits | None
) -> Any:
    """What "module:callable"(out_dir, **arguments) returns, run under `limits` where any are."""
    if limits is None:
        return _call(function, out_dir, arguments)
    context = multiprocessing.get_context("spawn")
    receive, send = context.Pipe(duplex=False)
    child = context.Process(target=_child, args=(send, function, out_dir, arguments, limits))
    child.start()
    send.close()
    try:
        if not receive.poll(limits.timeout_s):
            raise LuxError(f"took longer than {limits.timeout_s:g} s and was stopped.")
        problem, returned = receive.recv()
    except EOFError as error:
        child.join()
        raise LuxError(f"its process ended with code {child.exitcode}.") from error
    finally:
        child.kill()
        child.join()
    if problem is not None:
        raise LuxError(problem)
    return returned


def sentence(error: BaseException) -> str:
    """What a failure is called in the quarantine: ours are sentences, others have a name too."""
    return str(error) if isinstance(error, LuxError) else f"{type(error).__name__}: {error}"


def _child(
    send: Connection, function: str, out_dir: Path, arguments: dict[str, Any], limits: Limits
) -> None:
    # As its parent, a worker that a signal may end without a word: it would leave an orphan.
    die_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if limits.memory_mb is not None:
        resource.setrlimit(resource.RLIMIT_AS, (limits.memory_mb << 20,) * 2)
    problem = returned = None
    try:
        returned = _call(function, out_dir, arguments)
    except MemoryError:
        problem = f"needed more than {limits.memory_mb} MB."
    except Exception as error:
        problem = sentence(error)
    send.send((problem, returned))


def _call(function: str, out_dir: Path, arguments: dict[str, Any]) -> Any:
    module, name = function.split(":")
    return getattr(importlib.import_module(module), name)(out_dir, **arguments)
