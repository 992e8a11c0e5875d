"""The paper's 112 evaluation cases on the public test scenes, for who has that data.

The public repository's `data/paper_eval_cases.json` names scenes, views and OLAT passes;
`data/camera_params_48.json` the perspective cameras, single view and 32 views a scene.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from luxcore.data.crops import LitCrop, ViewSource, with_lamps
from luxcore.data.panorama import view_rotation
from luxcore.data.public_names import SCENE_ID
from luxcore.data.public_reader import PublicScene
from luxcore.data.training import lamps_in_sight
from luxcore.errors import FormatError, InputError

PAPER_SIDE = 512
FULL_MIX = 0
_MAX_BYTES = 50_000_000


@dataclass(frozen=True)
class PaperPose:
    """A square perspective photo of a panorama. Angles are the public tools' own, in radians."""

    view: int
    azimuth_rad: float
    elevation_rad: float
    fov_deg: float

    @property
    def rotation(self) -> Float[np.ndarray, "3 3"]:
        """Camera to panorama axes.

        The public tools look along −(cosθ·cosφ, sinθ, cosθ·sinφ) in axes with y up and the
        panorama's centre along −z: azimuth 90° − φ and elevation −θ in ours.
        """
        azimuth, elevation = math.degrees(self.azimuth_rad), math.degrees(self.elevation_rad)
        return view_rotation(90.0 - azimuth, -elevation)


@dataclass(frozen=True)
class PaperScene:
    """What Tables 1 and 2 score of one scene."""

    scene_id: str
    passes: tuple[int, ...]
    """The OLAT passes that are scored."""
    single: PaperPose
    multi: tuple[PaperPose, ...]
    scored: tuple[int, ...]
    """Indices into `multi` of the views that Table 2 scores."""


def read_paper_scenes(cases_file: Path, cameras_file: Path) -> list[PaperScene]:
    """The scenes of the paper's tables in order. Raises InputError or FormatError by file."""
    cases, cameras = _read_object(Path(cases_file)), _read_object(Path(cameras_file))
    try:
        scored = tuple(int(view) for view in cases["mv_eval_views"])
        return [
            _scene(name, about, cameras[name], scored)
            for name, about in sorted(cases["scenes"].items())
        ]
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise FormatError(
            f"{cases_file} and {cameras_file} do not fit together: {error!r}."
        ) from error


def paper_crop(
    scene: PublicScene,
    pose: PaperPose,
    pass_id: int,
    *,
    side_px: int = PAPER_SIDE,
    mask_kind: str = "hull",
) -> LitCrop:
    """The photo of a case, all lamps at full power; the lamp of `pass_id` is lamp 0."""
    [crop] = paper_crops(scene, [pose], pass_id, side_px=side_px, mask_kind=mask_kind)
    return crop


def paper_crops(
    scene: PublicScene,
    poses: Sequence[PaperPose],
    pass_id: int,
    *,
    side_px: int = PAPER_SIDE,
    mask_kind: str = "hull",
) -> list[LitCrop]:
    """Photos of one scene that carry the same lamps, the one of `pass_id` first.

    Raises InputError for a pass that the scene lacks.
    """
    if pass_id not in scene.olat_passes:
        raise InputError(f"scene {scene.scene_id} has no pass {pass_id:04d}.")
    views = sorted({pose.view for pose in poses})
    sources = {view: ViewSource(scene.read_view(view, FULL_MIX)) for view in views}
    crops = [sources[p.view].cut(p.rotation, p.fov_deg, side_px, side_px, mask_kind) for p in poses]
    target = scene.olat_passes.index(pass_id)
    seen = {i for crop in crops for i in lamps_in_sight(crop.masks, None)} - {target}
    return [with_lamps(crop, [target, *sorted(seen)]) for crop in crops]


def _scene(
    name: str, about: dict[str, Any], cameras: dict[str, Any], scored: tuple[int, ...]
) -> PaperScene:
    if not SCENE_ID.fullmatch(name):
        raise ValueError(f"scene id {name!r}")
    single = _pose(cameras["sv"], cameras["sv"]["view_id"])
    if single.view != int(about["view_id"]):
        raise ValueError(f"scene {name} is scored in a view that has no camera")
    multi = sorted(cameras["mv"], key=lambda entry: int(entry["mv_id"]))
    poses = tuple(_pose(entry, entry["pano_view_id"]) for entry in multi)
    if max(scored, default=-1) >= len(poses):
        raise ValueError(f"scene {name} has {len(poses)} views, fewer than are scored")
    return PaperScene(name, tuple(int(p) for p in about["pass_ids"]), single, poses, scored)


def _pose(entry: dict[str, Any], view: Any) -> PaperPose:
    values = [float(entry[key]) for key in ("azimuth", "elevation", "fov")]
    if not np.isfinite(values).all():
        raise ValueError("a camera angle is not finite")
    return PaperPose(int(view), *values)


def _read_object(path: Path) -> dict[str, Any]:
    if not path.is_file():
        raise InputError(f"{path} does not exist.")
    if path.stat().st_size > _MAX_BYTES:
        raise FormatError(f"{path} is too large for a list of cases.")
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path} is not JSON: {error}.") from error
    if not isinstance(value, dict):
        raise FormatError(f"{path} is not a JSON object.")
    return value
