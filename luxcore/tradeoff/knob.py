"""A knob: one parameter that trades accuracy for time, and how to measure both in one run."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from luxcore.errors import InputError
from luxcore.rooms import Room
from luxcore.rooms.batch import demo_room
from luxcore.settings.project import ProjectSettings

DEMO = "demo"


@dataclass(frozen=True)
class Bench:
    """What knobs are measured on: the artifacts of a run, and a folder to write into."""

    artifacts: Path
    scratch: Path
    params: ProjectSettings
    capture: str
    """Id of the capture; a rendered room has known truth, photos have not."""

    def input(self, stage: str) -> Path:
        """The capture's folder of a stage. Raises InputError where it has not run."""
        folder = self.artifacts / stage / self.capture
        if not folder.is_dir():
            raise InputError(f"{folder} does not exist: run the flow first (`lux run`).")
        return folder

    def demo_room(self) -> Room:
        """The room that renders are measured on. Raises InputError for any other capture."""
        if self.capture != DEMO:
            raise InputError(f"renders are measured on the room of capture {DEMO} only.")
        return demo_room(self.params.rooms)


@dataclass(frozen=True)
class Work:
    """One measurement."""

    cpu_s: float
    wall_s: float
    error: float


@dataclass(frozen=True)
class Choice:
    """One value of a knob. `settings` is what it means in params.yaml."""

    label: str
    settings: dict[str, Any]

    def section(self, name: str) -> dict[str, Any]:
        """The settings of one section of params.yaml, without its name."""
        prefix = f"{name}."
        return {k.removeprefix(prefix): v for k, v in self.settings.items() if k.startswith(prefix)}


@dataclass(frozen=True)
class Knob:
    """`run(prepared, choice, repeat)` does the work once and says how long and how wrong it was."""

    name: str
    work: str
    """What is done. The first knob of a work can run it with the settings of all its knobs."""
    choices: tuple[Choice, ...]
    error: str
    """What the error is, with its unit; smaller is better."""
    why: str
    """Why the default sits where it does, in one sentence."""
    prepare: Callable[[Bench], Any]
    run: Callable[[Any, Choice, int], Work]
    fixed_default: str = ""
    """Label of the default where it is no parameter but built in."""

    def default(self, params: ProjectSettings) -> str:
        """Label of the choice that the settings make."""
        if self.fixed_default:
            return self.fixed_default
        for choice in self.choices:
            if all(_setting(params, path) == v for path, v in choice.settings.items()):
                return choice.label
        return ""


def _setting(params: ProjectSettings, path: str) -> Any:
    value: Any = params
    for name in path.split("."):
        value = value.get(name) if isinstance(value, dict) else getattr(value, name)
    return value


def around(default: int, *factors: int | float) -> tuple[int, ...]:
    """Whole multiples of a default, so that a sweep follows it when it moves."""
    return tuple(max(1, round(default * factor)) for factor in factors)


@dataclass
class Stopwatch:
    """Seconds of this process, its threads and its finished children."""

    cpu_s: float = 0.0
    wall_s: float = 0.0

    def work(self, error: float) -> Work:
        """The measurement, once the watch has stopped."""
        return Work(self.cpu_s, self.wall_s, float(error))


@contextmanager
def stopwatch() -> Iterator[Stopwatch]:
    """Time what happens inside; errors are computed outside."""
    watch = Stopwatch()
    cpu, wall = _cpu_s(), time.perf_counter()
    yield watch
    watch.cpu_s, watch.wall_s = _cpu_s() - cpu, time.perf_counter() - wall


def _cpu_s() -> float:
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime
