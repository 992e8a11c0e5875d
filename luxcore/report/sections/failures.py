"""What went wrong, chosen by worst score and by nothing else."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from luxcore.light.agx import agx
from luxcore.metrics.image import psnr
from luxcore.metrics.rescale import channel_scale
from luxcore.report.content import Picture, Section, Strip, Table
from luxcore.report.gallery import Gallery
from luxcore.report.sources import CaptureFiles, find_captures, light_names

SHOWN = 6
OF_EACH_LAMP = 2
"""Views of one lamp among the worst; neighbouring views fail alike."""


@dataclass(frozen=True)
class Case:
    """One lamp in one view, against the truth."""

    capture: CaptureFiles
    view: int
    light: str
    psnr_db: float
    estimate: np.ndarray
    truth: np.ndarray


def chapter(artifacts: Path, gallery: Gallery, facts: dict[str, Any]) -> Section | None:
    """The lamps and views furthest from the truth, over every capture that has one."""
    worst: list[Case] = []
    scores: list[float] = []
    for capture in find_captures(artifacts):
        for view in range(len(capture.images)):
            cases = _cases(capture, view)
            scores += [case.psnr_db for case in cases]
            worst = _worst([*worst, *cases])
    worst = worst[:SHOWN]
    if not worst:
        return None
    strips = tuple(_strip(case, gallery) for case in worst)
    intro = (
        f"The worst of {len(scores)} (view, lamp) pairs with known truth, at most {OF_EACH_LAMP} "
        "views of a lamp, by PSNR after AgX with one factor per colour channel. "
        f"Median of all: {np.median(scores):.1f} dB."
    )
    return Section("Failures", "failures", intro, (_table(worst), *strips))


def _worst(cases: list[Case]) -> list[Case]:
    """The worst views of every lamp, worst first."""
    seen: Counter[tuple[str, str]] = Counter()
    kept = []
    for case in sorted(cases, key=lambda case: case.psnr_db):
        seen[case.capture.id, case.light] += 1
        if seen[case.capture.id, case.light] <= OF_EACH_LAMP:
            kept.append(case)
    return kept


def _cases(capture: CaptureFiles, view: int) -> list[Case]:
    estimate, truth = capture.fused(view), capture.truth(view)
    if estimate is None or truth is None:
        return []
    cases = []
    for light in light_names(truth):
        # A lamp that the proposals missed has no estimate: the masks chapter shows that.
        if light in estimate and estimate[light].shape == truth[light].shape:
            factor = channel_scale(estimate[light], truth[light]).astype(np.float32)
            scaled = estimate[light] * factor
            score = psnr(agx(capture.exposure * scaled), agx(capture.exposure * truth[light]))
            cases.append(Case(capture, view, light, score, scaled, truth[light]))
    return cases


def _table(worst: list[Case]) -> Table:
    rows = tuple(
        (
            case.capture.id,
            case.capture.lamp_name(int(case.light.split("_")[1])),
            str(case.view),
            f"{case.psnr_db:.2f}",
        )
        for case in worst
    )
    return Table("The worst", "fuse", ("capture", "lamp", "view", "PSNR, dB"), rows)


def _strip(case: Case, gallery: Gallery) -> Strip:
    lamp = case.capture.lamp_name(int(case.light.split("_")[1]))
    prefix = f"failure-{case.capture.id}-{case.light}-{case.view:04d}"
    g = case.capture.exposure
    difference = np.abs(agx(g * case.estimate) - agx(g * case.truth))
    pictures: tuple[Picture, ...] = (
        gallery.display(f"{prefix}-photo", case.capture.photo(case.view), "photo"),
        gallery.linear(f"{prefix}-estimate", case.estimate, g, "estimate, rescaled"),
        gallery.linear(f"{prefix}-truth", case.truth, g, "truth"),
        gallery.display(f"{prefix}-difference", difference, "absolute difference"),
    )
    title = f"{case.capture.id}: {lamp}, view {case.view}, {case.psnr_db:.1f} dB"
    return Strip(title, "fuse", pictures, columns=4)
