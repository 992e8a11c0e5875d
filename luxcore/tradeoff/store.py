"""The file of measurements: sweeps, and what advice taken from them turned out to give."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from luxcore.errors import FormatError, InputError
from luxcore.files.atomic import write_json
from luxcore.tradeoff.advise import Trial, Tried
from luxcore.tradeoff.knob import Work
from luxcore.tradeoff.sweep import Point, Sweep

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
        return Measured(
            data["about"],
            tuple(_sweep(record) for record in data["sweeps"]),
            tuple(_trial(record) for record in data["trials"]),
        )
    except (ValueError, KeyError, TypeError) as error:
        raise FormatError(f"{path} does not hold sweeps: {error!r}.") from error


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


def _sweep(record: dict[str, Any]) -> Sweep:
    points = tuple(
        Point(p["label"], p["settings"], tuple(Work(**work) for work in p["works"]))
        for p in record["points"]
    )
    return Sweep(**{**record, "points": points})


def _trial(record: dict[str, Any]) -> Trial:
    works = tuple(
        Tried(**{**tried, "obtained": Work(**tried["obtained"])}) for tried in record["works"]
    )
    return Trial(record["asked"], record["scene"], works)
