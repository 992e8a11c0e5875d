"""The whole of `params.yaml`, one section per stage."""

from __future__ import annotations

from pydantic import Field

from luxcore.settings.base import Settings
from luxcore.settings.capture import CaptureSettings
from luxcore.settings.decompose import DecomposeSettings
from luxcore.settings.evaluate import EvaluateSettings
from luxcore.settings.fuse import FuseSettings
from luxcore.settings.harmonize import HarmonizeSettings
from luxcore.settings.masks import MasksSettings
from luxcore.settings.relight import RelightSettings
from luxcore.settings.render import RenderSettings
from luxcore.settings.report import ReportSettings
from luxcore.settings.rooms import RoomsSettings
from luxcore.settings.splat import SplatSettings
from luxcore.settings.train_mv import TrainMvSettings
from luxcore.settings.train_sv import TrainSvSettings


class ProjectSettings(Settings):
    """Every parameter of a run. What is left out takes its default."""

    seed: int = Field(0, ge=0, lt=2**31, description="seed of everything random; 0 is legal")
    rooms: RoomsSettings = RoomsSettings()
    render: RenderSettings = RenderSettings()
    train_sv: TrainSvSettings = TrainSvSettings()
    train_mv: TrainMvSettings = TrainMvSettings()
    capture: CaptureSettings = CaptureSettings()
    splat: SplatSettings = SplatSettings()
    masks: MasksSettings = MasksSettings()
    decompose: DecomposeSettings = DecomposeSettings()
    harmonize: HarmonizeSettings = HarmonizeSettings()
    fuse: FuseSettings = FuseSettings()
    relight: RelightSettings = RelightSettings()
    evaluate: EvaluateSettings = EvaluateSettings()
    report: ReportSettings = ReportSettings()
