"""Units of work inside a stage: keyed by content, stored whole or not at all, resumable."""

from luxcore.units.executor import Executor, executor_from_environment
from luxcore.units.runner import Unit, UnitsResult, read_seconds, run_units
from luxcore.units.store import UnitStore, unit_key

__all__ = [
    "Executor",
    "Unit",
    "UnitStore",
    "UnitsResult",
    "executor_from_environment",
    "read_seconds",
    "run_units",
    "unit_key",
]
