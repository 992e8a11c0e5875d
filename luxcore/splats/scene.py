"""A relightable scene on disk: plain splats that any viewer opens, and the light of every lamp.

scene.json           version, name, lamps, views, tone, sha256 of the other files
splats.ply           3DGS PLY: geometry, and the colours of the room as it was photographed
lights.safetensors   "radiance" [N, M, 3] float32, linear; ambient first; the order of the PLY
transforms.json      the cameras of the photos
thumbnails/lamp_0.png
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32

from luxcore.cameras import Camera, camera_to_nerfstudio
from luxcore.errors import FormatError
from luxcore.files.atomic import atomic_file, write_json
from luxcore.files.digests import file_digest
from luxcore.files.json_numbers import finite, flag, positive, three, whole
from luxcore.splats.gaussians import Gaussians
from luxcore.splats.light_views import AMBIENT
from luxcore.splats.ply import read_ply, write_ply
from luxcore.splats.scene_files import FILES, VERSION, check_scene


@dataclass(frozen=True)
class SceneLamp:
    """One switch. `scale` [3] times its radiance is its share of the photos when it is on."""

    index: int
    name: str
    on: bool
    """Whether it shone when the photos were taken."""
    scale: tuple[float, float, float]


@dataclass(frozen=True)
class SceneTone:
    """How linear radiance is shown: display = AgX(exposure · radiance).

    `beta` and `gamma` are the curve (v + beta)^(1/gamma) that was learnt beside the lights.
    """

    exposure: float
    beta: float
    gamma: float


@dataclass(frozen=True)
class Scene:
    """Gaussians and the linear radiance [n, m, 3] of each light on them, ambient first."""

    name: str
    gaussians: Gaussians
    radiance: Float32[np.ndarray, "n m 3"]
    lamps: tuple[SceneLamp, ...]
    ambient_scale: tuple[float, float, float]
    tone: SceneTone
    views: int
    metric: bool = False
    """Whether a unit of the world is known to be a metre."""


def save_scene(
    folder: Path,
    scene: Scene,
    cameras: Sequence[Camera],
    thumbnails: Mapping[str, Path] | None = None,
) -> None:
    """Write a scene into `folder`, scene.json last: without it there is no scene."""
    from safetensors.numpy import save_file

    folder.mkdir(parents=True, exist_ok=True)
    write_ply(folder / "splats.ply", scene.gaussians)
    with atomic_file(folder / "lights.safetensors") as temporary:
        save_file({"radiance": np.ascontiguousarray(scene.radiance)}, temporary)
    frames = [camera_to_nerfstudio(camera) for camera in cameras]
    write_json(folder / "transforms.json", {"camera_model": "PINHOLE", "frames": frames})
    for name, picture in (thumbnails or {}).items():
        (folder / "thumbnails").mkdir(exist_ok=True)
        shutil.copyfile(picture, folder / "thumbnails" / name)
    about = {
        "version": VERSION,
        "name": scene.name,
        "lamps": [asdict(lamp) for lamp in scene.lamps],
        "ambient_scale": list(scene.ambient_scale),
        "tone": asdict(scene.tone),
        "views": scene.views,
        "metric": scene.metric,
        "digests": {name: file_digest(folder / name) for name in FILES},
    }
    write_json(folder / "scene.json", about)


def load_scene(folder: Path) -> Scene:
    """Read a scene, checking version, digests and that all files are of one population.

    Raises InputError when there is no scene, FormatError naming the file and the fact otherwise.
    """
    folder = Path(folder)
    about = check_scene(folder)
    gaussians = read_ply(folder / "splats.ply")
    radiance = _read_radiance(folder / "lights.safetensors", len(gaussians))
    try:
        lamps = tuple(_lamp(record) for record in about["lamps"])
        _check_names(lamps)
        scene = Scene(
            name=str(about["name"]),
            gaussians=gaussians,
            radiance=radiance,
            lamps=lamps,
            ambient_scale=three(about["ambient_scale"], "ambient_scale"),
            tone=_tone(about["tone"]),
            views=whole(about["views"], "views"),
            metric=flag(about.get("metric", False), "metric"),
        )
    except (KeyError, TypeError) as error:
        raise FormatError(f"{folder / 'scene.json'} lacks a usable {error}.") from error
    except ValueError as error:
        raise FormatError(f"{folder / 'scene.json'}: {error}.") from error
    if radiance.shape[1] != len(lamps) + 1:
        raise FormatError(
            f"{folder / 'lights.safetensors'} holds {radiance.shape[1]} lights, "
            f"scene.json names {len(lamps)} lamps and ambient."
        )
    return scene


def _read_radiance(path: Path, count: int) -> Float32[np.ndarray, "n m 3"]:
    from safetensors import SafetensorError
    from safetensors.numpy import load_file

    try:
        radiance = load_file(path)["radiance"]
    except (SafetensorError, KeyError, TypeError, AttributeError) as error:
        # The last two: numbers of a type that NumPy does not have.
        raise FormatError(f"{path} holds no tensor called radiance: {error}.") from error
    if radiance.dtype != np.float32 or radiance.ndim != 3 or radiance.shape[2] != 3:
        raise FormatError(
            f"{path}: radiance must be float32 [n, m, 3], got {radiance.dtype} {radiance.shape}."
        )
    if len(radiance) != count:
        raise FormatError(f"{path} holds light for {len(radiance)} Gaussians, the PLY has {count}.")
    if not np.isfinite(radiance).all():
        raise FormatError(f"{path} has radiance that is not finite.")
    return radiance


def _lamp(record: dict[str, Any]) -> SceneLamp:
    name = str(record["name"])
    return SceneLamp(
        index=whole(record["index"], f"the index of lamp {name}"),
        name=name,
        on=flag(record["on"], f"on of lamp {name}"),
        scale=three(record["scale"], f"the scale of lamp {name}"),
    )


def _check_names(lamps: Sequence[SceneLamp]) -> None:
    """Lamps are set by their names, beside the ambient light."""
    names = [AMBIENT, *(lamp.name for lamp in lamps)]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ValueError(f"two lights are called {twice!r:.80}")


def _tone(record: dict[str, Any]) -> SceneTone:
    return SceneTone(
        exposure=positive(record["exposure"], "the tone's exposure"),
        beta=finite(record["beta"], "the tone's beta"),
        gamma=positive(record["gamma"], "the tone's gamma"),
    )
