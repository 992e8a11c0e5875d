"""What a stage is given: its settings, its inputs, its own folder, and where to report."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from luxcore.errors import InputError, LuxError
from luxcore.settings.project import ProjectSettings
from luxcore.units import Executor, UnitStore, executor_from_environment
from luxcore.units.store import damaged_files

STAGE_NAMES = tuple(name for name in ProjectSettings.model_fields if name != "seed")
"""A stage is a section of the settings, a module of this package and an artifact folder."""


def artifact_folder(name: str) -> str:
    """Where a stage writes, relative to the project root."""
    return "reports" if name == "report" else f"artifacts/{name}"


def metrics_file(name: str) -> str:
    """Flat metrics of a stage, declared to DVC; timings are never in it."""
    return f"artifacts/metrics/{name}.json"


@dataclass
class StageContext:
    """One execution of one stage."""

    name: str
    params: ProjectSettings
    root: Path
    """The project root; every artifact folder is below it."""
    metrics: dict[str, float] = field(default_factory=dict)
    series: list[tuple[str, float, int]] = field(default_factory=list)
    """(name, value, step) of curves."""
    pictures: dict[str, Path | np.ndarray] = field(default_factory=dict)
    timings: dict[str, Any] = field(default_factory=dict)
    """Seconds of anything. They never enter an artifact, so equal runs have equal bytes."""
    _checked: set[str] = field(default_factory=set)

    @property
    def settings(self) -> Any:
        """The stage's own section of `params.yaml`."""
        return getattr(self.params, self.name)

    @property
    def seed(self) -> int:
        return self.params.seed

    @property
    def out(self) -> Path:
        """The stage's artifact folder, empty when the stage starts."""
        return self.root / artifact_folder(self.name)

    def input(self, name: str) -> Path:
        """The artifact folder of a stage that this one needs, checked against its manifest."""
        folder = self.root / artifact_folder(name)
        if not folder.is_dir():
            raise InputError(f"{folder} does not exist: run stage {name} first.")
        damaged = [] if name in self._checked else damaged_files(folder)
        self._checked.add(name)
        if damaged:
            # A flipped bit in DVC's cache goes unseen by DVC itself; readers must look.
            raise LuxError(f"{folder / damaged[0]} is not what stage {name} wrote; run it again.")
        return folder

    @property
    def captures(self) -> list[str]:
        """Ids of the captures at hand."""
        return sorted(f.parent.name for f in self.input("capture").glob("*/capture.json"))

    @cached_property
    def store(self) -> UnitStore:
        """Finished units, outside of DVC's outs so that a killed stage resumes."""
        return UnitStore(Path(os.environ.get("LUX_UNITS", self.root / ".lux" / "units")))

    @cached_property
    def executor(self) -> Executor:
        return executor_from_environment()

    def log_metric(self, name: str, value: float, step: int | None = None) -> None:
        """A number; with `step`, a point of a curve."""
        if step is None:
            self.metrics[name] = float(value)
        else:
            self.series.append((name, float(value), step))

    def log_metrics(self, values: dict[str, float]) -> None:
        self.metrics.update({name: float(value) for name, value in values.items()})

    def log_picture(self, name: str, picture: Path | np.ndarray) -> None:
        """A PNG or JPEG file, or an array [h, w, 3] in 0..1, shown beside the run in mlflow."""
        self.pictures[name] = picture

    def log_timing(self, name: str, value: Any) -> None:
        """Seconds, or a list of records with seconds; kept beside the artifacts, not in them."""
        self.timings[name] = value
