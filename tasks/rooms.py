"""Stage rooms: procedural rooms with lamps, from seeds alone."""

from __future__ import annotations

from luxcore.rooms.batch import write_rooms
from tasks.context import StageContext


def run(stage: StageContext) -> None:
    """Training, held-out and demo rooms as JSON."""
    stage.log_metrics({k: float(v) for k, v in write_rooms(stage.out, stage.settings).items()})
