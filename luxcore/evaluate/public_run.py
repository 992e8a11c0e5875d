"""The paper's Tables 1 and 2 on the paper's own cases, for a user who has the public data."""

from __future__ import annotations

from pathlib import Path

from luxcore.evaluate.multi import multi_table
from luxcore.evaluate.public_cases import (
    PublicGroups,
    public_cases,
    read_cameras,
    read_case_list,
)
from luxcore.evaluate.run import open_models
from luxcore.evaluate.single import single_table
from luxcore.evaluate.table import PAPER_MULTI, PAPER_SINGLE, flat_metrics, write_table
from luxcore.settings.evaluate import EvaluateSettings

NOTE = (
    "The paper's scenes, lamps and cameras. Photos are cut from the panoramas directly, the "
    "paper's through a cube map of 512 pixels a side, which blurs a little; masks are the "
    "fixtures', where the paper mixes kinds of masks."
)


def evaluate_public(
    dataset: Path,
    case_list: Path,
    cameras: Path,
    out: Path,
    settings: EvaluateSettings,
    *,
    sv_weights: Path | None = None,
    mv_weights: Path | None = None,
    seed: int = 0,
) -> dict[str, float]:
    """Both tables on the test scenes in `dataset` (shards or folders); writes `out`/tables
    and returns the metrics. Photos are `settings.size_px` a side; the paper's
    are 512. Raises InputError naming what of the list is missing, before anything is scored.
    """
    listed, known = read_case_list(case_list), read_cameras(cameras)
    groups = PublicGroups(dataset, listed, known, settings.size_px)
    cases = public_cases(dataset, listed, known, settings.size_px)
    models = open_models(settings, sv_weights, mv_weights, seed)
    single = single_table(cases, models.decomposer, "lamp on", seed).rows
    write_table(
        out / "tables", "public_single", "Table 1, public cases", single, PAPER_SINGLE, [NOTE]
    )
    multi = multi_table(groups, models).rows
    write_table(out / "tables", "public_multi", "Table 2, public cases", multi, PAPER_MULTI, [NOTE])
    metrics = flat_metrics("public_single", single) | flat_metrics("public_multi", multi)
    return metrics | {"public_cases": listed.cases, "public_images": listed.multi_images}
