"""Stage render: every lamp of every room by one light-group render a view."""

from __future__ import annotations

from luxcore.render.dataset import render_dataset
from luxcore.statistics.contact_sheet import write_contact_sheet
from tasks.context import StageContext


def run(stage: StageContext) -> None:
    """Panoramas of training and held-out rooms, perspective views of the demo room."""
    metrics = render_dataset(
        stage.input("rooms"), stage.out, stage.settings, stage.store, stage.executor
    )
    stage.log_metrics(metrics)
    sheet = stage.out / "contact_sheet.png"
    write_contact_sheet(stage.out, sheet)
    stage.log_picture("contact_sheet", sheet)
