"""Evaluate models on rendered views and captures: tables, flat metrics and pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from luxcore.data.crops import LitCrop
from luxcore.data.multiview import MultiViewSets
from luxcore.data.store import AnyView
from luxcore.evaluate.captures import capture_group
from luxcore.evaluate.cases import single_cases
from luxcore.evaluate.multi import MultiModels, MultiResult, multi_table
from luxcore.evaluate.pictures import comparison_sheet
from luxcore.evaluate.single import SingleResult, single_table
from luxcore.evaluate.table import (
    PAPER_MULTI,
    PAPER_SINGLE,
    Row,
    flat_metrics,
    write_table,
)
from luxcore.files.photos import write_png
from luxcore.models.backends import open_decomposer, open_harmonizer
from luxcore.models.interface import BackendSettings, Decomposer
from luxcore.settings.evaluate import EvaluateSettings

NOTE = "Our rows are measured on rooms of this project, the paper's on its own 30 rooms."


def evaluate_models(
    views: Sequence[AnyView],
    captures: Sequence[tuple[Path, Path]],
    out: Path,
    settings: EvaluateSettings,
    *,
    sv_weights: Path | None = None,
    mv_weights: Path | None = None,
    seed: int = 0,
) -> dict[str, float]:
    """Both tables on held-out `views` (stems of rendered views) and `captures` (capture folder,
    masks folder); writes tables/ and pictures/ into `out`, returns the metrics."""
    models = open_models(settings, sv_weights, mv_weights, seed)
    metrics = _evaluate_single(views, models.decomposer, out, settings, seed) if views else {}
    groups = multi_groups(views, captures, settings, seed)
    if groups:
        metrics |= _evaluate_multi(groups, models, out)
    return {name: round(value, 4) for name, value in metrics.items()}


def multi_groups(
    views: Sequence[AnyView],
    captures: Sequence[tuple[Path, Path]],
    settings: EvaluateSettings,
    seed: int,
) -> list[list[LitCrop]]:
    """Groups whose first view shows a lamp: from captures with truth, then from panoramas."""
    groups = [
        capture_group(capture, masks, settings.capture_views, settings.capture_side_px)
        for capture, masks in captures
    ]
    if views and settings.groups:
        size = (settings.size_px, settings.size_px)
        sets = MultiViewSets(views, size, seed, views_per_set=settings.views_per_group, relit=False)
        groups += [sets.crops(i, settings.views_per_group) for i in range(settings.groups)]
    return [g for g in groups if g is not None and len(g) > 1 and g[0].masks.any()]


def open_models(
    settings: EvaluateSettings, sv_weights: Path | None, mv_weights: Path | None, seed: int
) -> MultiModels:
    """The backends that the settings name, ready to be scored."""
    opening = BackendSettings(
        sv_weights=str(sv_weights) if sv_weights else None,
        mv_weights=str(mv_weights) if mv_weights else None,
        options=dict(settings.options),
    )
    unwarped = replace(opening, options={**opening.options, "warp": False})
    can_unwarp = settings.mv_backend == "small"
    return MultiModels(
        open_decomposer(settings.backend, opening),
        open_harmonizer(settings.mv_backend, opening),
        open_harmonizer(settings.mv_backend, unwarped) if can_unwarp else None,
        seed,
    )


def _evaluate_single(
    views: Sequence[AnyView],
    decomposer: Decomposer,
    out: Path,
    settings: EvaluateSettings,
    seed: int,
) -> dict[str, float]:
    rows: list[Row] = []
    metrics: dict[str, float] = {}
    for label, on in (("lamp on", True), ("lamp off", False)):
        cases = single_cases(views, settings.size_px, seed, on=on, limit=settings.cases)
        if not cases:
            continue
        result = single_table(cases, decomposer, label, seed)
        rows += result.rows
        metrics |= _side_metrics(result, label)
        sheet = comparison_sheet(cases, decomposer, seed)
        write_png(out / "pictures" / f"single_{label.replace(' ', '_')}.png", sheet)
    write_table(out / "tables", "single", "Single-view decomposition", rows, PAPER_SINGLE, [NOTE])
    return metrics | flat_metrics("single", rows)


def _side_metrics(result: SingleResult, label: str) -> dict[str, float]:
    prefix = f"single_{label.replace(' ', '_')}"
    return {
        f"{prefix}_recomposition_db": result.recomposition_db,
        f"{prefix}_leakage": result.leakage,
        f"{prefix}_leakage_truth": result.leakage_truth,
    }


def _evaluate_multi(
    groups: Sequence[Sequence[LitCrop]], models: MultiModels, out: Path
) -> dict[str, float]:
    result: MultiResult = multi_table(groups, models)
    agreement = [f"- {name}: {db:.2f} dB" for name, db in result.consistency_db.items()]
    notes = [NOTE, "", "Agreement of neighbouring views, one warped into the other by depth:", ""]
    write_table(
        out / "tables",
        "multi",
        "Multi-view harmonization",
        result.rows,
        PAPER_MULTI,
        [*notes, *agreement],
    )
    keys = {name: "_".join(name.replace(",", "").lower().split()) for name in result.consistency_db}
    consistency = {f"multi_consistency_db_{keys[n]}": db for n, db in result.consistency_db.items()}
    return consistency | flat_metrics("multi", result.rows)
