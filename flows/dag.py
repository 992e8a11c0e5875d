"""The DAG as data: one frozen record per stage. `dvc.yaml` and the Prefect flow come from here."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from graphlib import TopologicalSorter

from tasks.context import artifact_folder, metrics_file

SMALL_MODEL = (
    "luxcore/models/interface.py",
    "luxcore/models/backends.py",
    "luxcore/models/small",
    "luxcore/models/weights",
)
"""The default backend. The paper's own backends are no part of what the embedded run depends on."""

CAPTURES = ("luxcore/capture", "luxcore/light")
"""Reading photos with poses; `luxcore.capture` as a whole is loaded for it, AgX with it."""

SCORE = "luxcore/metrics/image.py"
"""PSNR, of which a stage's metrics and curves are made."""

COMMON_CODE = ("luxcore/files", "luxcore/units", "luxcore/cameras.py", "tasks/context.py")
"""Code that every stage runs; a change of it makes every stage stale."""


@dataclass(frozen=True)
class Stage:
    """One step of the pipeline, run as `python -m tasks NAME`."""

    name: str
    does: str
    """One line for people."""
    needs: tuple[str, ...] = ()
    """Stages whose artifact folders are read."""
    code: tuple[str, ...] = ()
    """Files and folders whose change makes the stage stale, beside its task module."""
    settings: tuple[str, ...] = ()
    """Sections of `params.yaml` beside the stage's own and the seed."""
    retries: int = 1
    """How often Prefect tries again after a failure: units already done are kept."""

    @property
    def folder(self) -> str:
        """The artifact folder relative to the project root."""
        return artifact_folder(self.name)

    @property
    def metrics_file(self) -> str:
        """Flat metrics of the stage, declared to DVC."""
        return metrics_file(self.name)

    @property
    def sections(self) -> tuple[str, ...]:
        """Sections of `params.yaml` that the stage reads, beside the seed."""
        return (self.name, *self.settings)

    @property
    def watched_code(self) -> tuple[str, ...]:
        """Every file and folder of code whose change makes the stage stale."""
        settings = (f"luxcore/settings/{section}.py" for section in self.sections)
        return (f"tasks/{self.name}.py", *settings, *self.code, *COMMON_CODE)


STAGES: tuple[Stage, ...] = (
    Stage(
        "rooms",
        "procedural rooms with lamps, from seeds alone",
        code=("luxcore/rooms", "luxcore/light/blackbody.py"),
    ),
    Stage(
        "render",
        "every lamp of every room by one light-group render a view",
        needs=("rooms",),
        code=(
            "luxcore/render",
            "luxcore/rooms",
            "luxcore/data",
            "luxcore/light",
            "luxcore/statistics/contact_sheet.py",
        ),
    ),
    Stage(
        "train_sv",
        "fine-tune the single-view decomposition model",
        needs=("render",),
        code=(*SMALL_MODEL, "luxcore/data", "luxcore/light"),
    ),
    Stage(
        "train_mv",
        "fine-tune the multi-view harmonization model",
        needs=("render",),
        code=(*SMALL_MODEL, "luxcore/data", "luxcore/light"),
    ),
    Stage(
        "capture",
        "photos with poses: a rendered room with known truth, and photos through SfM",
        needs=("render",),
        code=("luxcore/capture", "luxcore/light"),
    ),
    Stage(
        "splat",
        "stage 1: geometry as Gaussians, in the light the photos were taken in",
        needs=("capture",),
        code=("luxcore/splats", "kernels", *CAPTURES, SCORE),
    ),
    Stage(
        "masks",
        "which pixels are which lamp",
        needs=("capture",),
        code=("luxcore/masks", *CAPTURES),
    ),
    Stage(
        "decompose",
        "reference views into ambient and one image per lamp",
        needs=("capture", "masks", "splat", "train_sv"),
        code=("luxcore/decompose", *SMALL_MODEL, *CAPTURES, "luxcore/masks", SCORE),
    ),
    Stage(
        "harmonize",
        "the decomposition carried to every view, in chained passes of at most 15",
        needs=("capture", "masks", "splat", "decompose", "train_mv"),
        code=(
            "luxcore/harmonize",
            "luxcore/decompose",
            *SMALL_MODEL,
            *CAPTURES,
            "luxcore/masks",
            SCORE,
        ),
    ),
    Stage(
        "fuse",
        "three exposures per lamp and view merged to linear HDR",
        needs=("capture", "harmonize"),
        code=CAPTURES,
    ),
    Stage(
        "relight",
        "stage 2: HDR coefficients per lamp on every Gaussian",
        needs=("capture", "masks", "splat", "fuse"),
        code=("luxcore/splats", "kernels", *CAPTURES, "luxcore/masks", SCORE),
    ),
    Stage(
        "evaluate",
        "the tables: decomposition, harmonization and relighting against truth",
        needs=("render", "capture", "masks", "train_sv", "train_mv", "fuse", "relight"),
        code=(
            "luxcore/evaluate",
            "luxcore/metrics",
            *SMALL_MODEL,
            "luxcore/splats",
            "kernels",
            *CAPTURES,
            "luxcore/masks",
            "luxcore/data",
            "luxcore/decompose",
            "luxcore/harmonize",
        ),
        settings=("splat", "relight"),
    ),
    Stage(
        "report",
        "pictures, tables and curves on one page",
        needs=(
            "rooms",
            "render",
            "train_sv",
            "train_mv",
            "capture",
            "masks",
            "splat",
            "decompose",
            "harmonize",
            "fuse",
            "relight",
            "evaluate",
        ),
        code=(
            "luxcore/report",
            "luxcore/explorer",
            "luxcore/light",
            "luxcore/metrics",
            "luxcore/evaluate/answers.py",
            "luxcore/evaluate/table.py",
        ),
    ),
)

BY_NAME = {stage.name: stage for stage in STAGES}


def ordered() -> tuple[Stage, ...]:
    """Stages in an order that respects `needs`; ties in the order written above."""
    graph = {stage.name: stage.needs for stage in STAGES}
    return tuple(BY_NAME[name] for name in TopologicalSorter(graph).static_order())


def upstream(names: Iterable[str]) -> set[str]:
    """Names of all stages that `names` depend on, directly or not."""
    needed = {need for name in names for need in BY_NAME[name].needs}
    return needed | upstream(needed) if needed else set()
