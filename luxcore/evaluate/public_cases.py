"""The paper's own evaluation list on the public dataset: 30 scenes, 112 (scene, lamp) cases.

The list and the cameras are two files of the public dataset's repository, which the user has with
the data: `data/paper_eval_cases.json` and `data/camera_params_48.json`. Photos are cut from the
panoramas with those cameras, so that no perspective copy of the test scenes is needed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, overload

from luxcore.data.crops import LitCrop, ViewSource, with_lamps
from luxcore.data.panorama import view_rotation
from luxcore.data.public_files import find_scenes
from luxcore.data.public_names import SCENE_ID
from luxcore.data.public_reader import PublicScene
from luxcore.errors import FormatError, InputError
from luxcore.evaluate.cases import LampCase
from luxcore.files.input import check_input_file
from luxcore.files.json_object import read_object
from luxcore.progress import progress

REFERENCE_VIEW = 0
"""The multi-view photo that is the single-view case: its light is given to the model."""

PUBLIC_SIDE_PX = 512
MASK_KIND = "fixture"
MAX_BYTES = 20_000_000


@dataclass(frozen=True)
class ScoredScene:
    """A scene, the panorama that its single-view photo is cut from, and its scored OLAT passes."""

    scene_id: str
    view: int
    passes: tuple[int, ...]


@dataclass(frozen=True)
class CaseList:
    """The scored scenes in order, and the numbers of the multi-view photos that are scored."""

    scenes: tuple[ScoredScene, ...]
    multi_views: tuple[int, ...]

    @property
    def cases(self) -> int:
        """(scene, lamp) pairs: rows of the single-view table."""
        return sum(len(scene.passes) for scene in self.scenes)

    @property
    def multi_images(self) -> int:
        """Pictures that the multi-view table averages over."""
        return self.cases * len(self.multi_views)


@dataclass(frozen=True)
class PublicCamera:
    """A square photo out of a panorama. Angles as the file has them: azimuth and elevation in
    radians of the point on a sphere (y up) from which a camera looks at the centre."""

    view: int
    azimuth: float
    elevation: float
    fov_deg: float

    def cut(self, source: ViewSource, side_px: int) -> LitCrop:
        """The photo, shown at exposure 1 as the public previews are."""
        # The camera looks back along its own direction, and the layout's azimuth grows from +z.
        rotation = view_rotation(90 - math.degrees(self.azimuth), -math.degrees(self.elevation))
        crop = source.cut(rotation, self.fov_deg, side_px, side_px, MASK_KIND)
        return replace(crop, exposure=1.0)


@dataclass(frozen=True)
class SceneCameras:
    """The cameras of a scene's single-view photo and of its multi-view photos by number."""

    single: PublicCamera
    multi: dict[int, PublicCamera]


def read_case_list(path: Path) -> CaseList:
    """`paper_eval_cases.json`. Raises InputError (missing) or FormatError (another format)."""
    about = _read(path)
    try:
        views = tuple(int(view) for view in about["mv_eval_views"])
        scenes = tuple(
            ScoredScene(_scene_id(name), int(entry["view_id"]), tuple(map(int, entry["pass_ids"])))
            for name, entry in sorted(about["scenes"].items())
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise FormatError(f"{path} is not a list of evaluation cases: {error!r}.") from error
    if not scenes or any(not scene.passes for scene in scenes):
        raise FormatError(f"{path} lists no scenes, or a scene without lamps.")
    return CaseList(scenes, views)


def read_cameras(path: Path) -> dict[str, SceneCameras]:
    """`camera_params_48.json` by scene id. Raises InputError or FormatError."""
    about = _read(path)
    try:
        return {_scene_id(name): _cameras(entry) for name, entry in about.items()}
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise FormatError(f"{path} is not a list of cameras: {error!r}.") from error


def public_cases(
    dataset: Path,
    listed: CaseList,
    cameras: dict[str, SceneCameras],
    side_px: int = PUBLIC_SIDE_PX,
) -> list[LampCase]:
    """The single-view cases: all lamps on at full power, one scored lamp each.

    `dataset` holds the test scenes as shards or folders. Raises InputError naming what is missing.
    """
    cases = []
    with progress("public scenes", len(listed.scenes), "scenes") as bar:
        for scored, scene in _opened(dataset, listed, cameras):
            camera = cameras[scored.scene_id].single
            crop = camera.cut(ViewSource(scene.read_view(scored.view)), side_px)
            crop = with_lamps(crop, _lamps(scene, scored))
            cases += [LampCase(scored.scene_id, crop, lamp) for lamp in range(len(crop.on))]
            bar.advance()
    return cases


class PublicGroups(Sequence[list[LitCrop]]):
    """Per scene the reference photo and then the scored ones: 15 in the paper's list, one pass.

    A scene is read when it is asked for, and not kept: all of them would not fit in memory.
    """

    def __init__(
        self,
        dataset: Path,
        listed: CaseList,
        cameras: dict[str, SceneCameras],
        side_px: int = PUBLIC_SIDE_PX,
    ) -> None:
        """Raises InputError naming what is missing, before a picture is read."""
        self._scenes = _opened(dataset, listed, cameras)
        self._wanted = (REFERENCE_VIEW, *listed.multi_views)
        self._cameras, self._side_px = cameras, side_px
        for scored, scene in self._scenes:
            _lamps(scene, scored)
            known = cameras[scored.scene_id].multi
            missing = [number for number in self._wanted if number not in known]
            if missing:
                raise InputError(f"the cameras of scene {scored.scene_id} lack view {missing[0]}.")

    def __len__(self) -> int:
        return len(self._scenes)

    @overload
    def __getitem__(self, index: int) -> list[LitCrop]: ...
    @overload
    def __getitem__(self, index: slice) -> list[list[LitCrop]]: ...
    def __getitem__(self, index: int | slice) -> list[LitCrop] | list[list[LitCrop]]:
        if isinstance(index, slice):
            return [self[i] for i in range(len(self))[index]]
        scored, scene = self._scenes[index]
        cameras, lamps = self._cameras[scored.scene_id].multi, _lamps(scene, scored)
        photos = {}
        for view in sorted({cameras[number].view for number in self._wanted}):
            source = ViewSource(scene.read_view(view))
            for number in self._wanted:
                if cameras[number].view == view:
                    photos[number] = with_lamps(cameras[number].cut(source, self._side_px), lamps)
        return [photos[number] for number in self._wanted]


def _opened(
    dataset: Path, listed: CaseList, cameras: dict[str, SceneCameras]
) -> list[tuple[ScoredScene, PublicScene]]:
    found = {files.scene_id: PublicScene(files) for files in find_scenes(dataset)}
    for what, known in ((str(dataset), found), ("the list of cameras", cameras)):
        absent = [s.scene_id for s in listed.scenes if s.scene_id not in known]
        if absent:
            raise InputError(f"{what} lacks {len(absent)} listed scenes, the first is {absent[0]}.")
    return [(scored, found[scored.scene_id]) for scored in listed.scenes]


def _lamps(scene: PublicScene, scored: ScoredScene) -> list[int]:
    """Places of the scored lamps among the scene's; the light of the others is ambient."""
    absent = [number for number in scored.passes if number not in scene.olat_passes]
    if absent:
        raise InputError(f"scene {scored.scene_id} has no OLAT pass {absent[0]}.")
    return [scene.olat_passes.index(number) for number in scored.passes]


def _cameras(entry: dict[str, Any]) -> SceneCameras:
    multi = {int(e["mv_id"]): _camera(e, e["pano_view_id"]) for e in entry["mv"]}
    return SceneCameras(_camera(entry["sv"], entry["sv"]["view_id"]), multi)


def _camera(entry: dict[str, Any], view: str) -> PublicCamera:
    numbers = (float(entry["azimuth"]), float(entry["elevation"]), float(entry["fov"]))
    if not all(map(math.isfinite, numbers)) or not 0 < numbers[2] < 180:
        raise ValueError(f"angles {numbers}")
    return PublicCamera(int(view), *numbers)


def _scene_id(name: str) -> str:
    if not SCENE_ID.fullmatch(name):
        raise ValueError(f"scene id {name!r}")
    return name


def _read(path: Path) -> dict[str, Any]:
    path = Path(path)
    check_input_file(path)
    if path.stat().st_size > MAX_BYTES:
        raise FormatError(f"{path} is too large for a list.")
    return read_object(path)
