"""The file of measurements: sweeps, and what advice taken from them turned out to give."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from luxcore.errors import FormatError, InputError
from luxcore.files.atomic import write_json
from luxcore.tradeoff.advise import Trial
from luxcore.tradeoff.sweep import Sweep

VERSION = 2


@dataclass(frozen=True)
class Measured:
    """Everything that `lux tradeoff` keeps."""

    about: dict[str, Any]
    """On which machine; other machines' sweeps are not mixed in."""
    sweeps: tuple[Sweep, ...]
    trials: tuple[Trial, ...] = ()

    def of(self, scene: str) -> list[Sweep]:
        """The sweeps of one capture. Raises InputError when there are none."""
        found = [sweep for sweep in self.sweeps if sweep.scene == scene]
        if not found:
            known = ", ".join(sorted({sweep.scene for sweep in self.sweeps}))
            raise InputError(f"capture {scene} was not measured; there is: {known}.")
        return found


def save_measured(path: Path, measured: Measured) -> None:
    """Write `path`."""
    write_json(
        path,
        {
            "version": VERSION,
            "about": measured.about,
            "sweeps": [asdict(sweep) for sweep in measured.sweeps],
            "trials": [asdict(trial) for trial in measured.trials],
        },
    )


def load_measured(path: Path) -> Measured:
    """The measurements. Raises InputError or FormatError naming the file."""
    if not path.is_file():
        raise InputError(f"{path} does not exist: `lux tradeoff` measures it.")
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        if data["version"] != VERSION:
            raise FormatError(f"{path} is of version {data['version']}, not {VERSION}.")
        measured = TypeAdapter(Measured).validate_python(data)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise FormatError(
            f"{path} does not hold sweeps: {where}: {first['msg'].lower()}."
        ) from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise FormatError(f"{path} does not hold sweeps: {error}.") from error
    for sweep in measured.sweeps:
        if not _whole(sweep):
            raise FormatError(f"{path} holds a sweep that is not whole: {sweep.knob}.")
    return measured


def merged(
    path: Path, fresh: Sequence[Sweep], about: dict[str, Any], order: Sequence[str]
) -> Measured:
    """`fresh` and what `path` holds of the same machine, by knob in `order` and by capture.

    Trials are kept where nothing of their capture was measured again.
    """
    old = load_measured(path) if path.is_file() else Measured(about, ())
    if old.about != about:
        return Measured(about, tuple(fresh))
    latest = {(sweep.knob, sweep.scene): sweep for sweep in (*old.sweeps, *fresh)}
    scenes = sorted({scene for _, scene in latest})
    kept = [latest[name, scene] for name in order for scene in scenes if (name, scene) in latest]
    again = {sweep.scene for sweep in fresh}
    trials = tuple(trial for trial in old.trials if trial.scene not in again)
    return Measured(about, tuple(kept), trials)


def with_trial(measured: Measured, trial: Trial) -> Measured:
    """The measurements with `trial` in place of an earlier one of the same question."""
    others = [t for t in measured.trials if (t.asked, t.scene) != (trial.asked, trial.scene)]
    return Measured(measured.about, measured.sweeps, (*others, trial))


def _whole(sweep: Sweep) -> bool:
    """Whether every choice was measured, and the default is one of them; a few have none."""
    works = [work for point in sweep.points for work in point.works]
    return (
        all(point.works for point in sweep.points)
        and all(math.isfinite(work.cpu_s) and math.isfinite(work.error) for work in works)
        and (not sweep.default or sweep.default in {point.label for point in sweep.points})
    )
