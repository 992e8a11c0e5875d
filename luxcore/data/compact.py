"""The compact form of one rendered view, read back: every light, its masks, and the surfaces."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from luxcore.cameras import Camera, camera_from_nerfstudio, camera_to_nerfstudio, pose_problem
from luxcore.errors import FormatError, InputError
from luxcore.files.atomic import write_json
from luxcore.files.exr import read_exr, write_exr
from luxcore.files.json_numbers import finite, flag, parse_json, positive, three

MASK_KINDS = ("emitter", "fixture", "hull")
MASKS_FILE = ".masks.exr"
COMPACT_VERSION = 1


@dataclass(frozen=True)
class Lamp:
    """One editable lamp. `scale` is c_i: its share of the photo is scale · light, when it is on."""

    name: str
    kind: str
    position: tuple[float, float, float]
    power_w: float
    color: tuple[float, float, float]
    on: bool
    scale: tuple[float, float, float]


@dataclass(frozen=True)
class RenderedView:
    """One panorama or perspective view of a rendered room; linear Rec.709, metres.

    `camera` is None for a panorama; `c2w` [4, 4] is then the rotation of the panorama's own axes
    (centre along +x, z up) and its centre. `lights[i]` is lamp i at unit white. Normals are in
    world axes. `exposure` is g: the photo is AgX(g · as_taken).
    """

    room: str
    kind: str
    c2w: Float[np.ndarray, "4 4"]
    camera: Camera | None
    ambient: Float[np.ndarray, "h w 3"]
    lights: Float[np.ndarray, "m h w 3"]
    albedo: Float[np.ndarray, "h w 3"]
    normal: Float[np.ndarray, "h w 3"]
    ray_distance_m: Float[np.ndarray, "h w"]
    masks: dict[str, Bool[np.ndarray, "m h w"]]
    """By kind: "emitter", "fixture", "hull"."""
    window: Bool[np.ndarray, "h w"]
    lamps: tuple[Lamp, ...]
    exposure: float
    metadata: dict[str, Any] = field(default_factory=dict)

    @property
    def scale(self) -> Float[np.ndarray, "m 3"]:
        """c_i of all lamps, whether on or off."""
        return np.array([lamp.scale for lamp in self.lamps], np.float32).reshape(-1, 3)

    @property
    def on(self) -> Bool[np.ndarray, " m"]:
        """Which lamps burn in the photo as taken."""
        return np.array([lamp.on for lamp in self.lamps], bool)


def load_rendered(path_stem: Path) -> RenderedView:
    """Read `<stem>.exr`, `.geometry.exr`, `.masks.exr` and `.json`; a suffix .json or .exr is cut.

    Raises InputError (missing file) or FormatError (a file that does not fit the others).
    """
    stem = _stem(Path(path_stem))
    about = read_metadata(stem)
    images, geometry = read_exr(_beside(stem, ".exr")), read_exr(_beside(stem, ".geometry.exr"))
    masks = read_exr(_beside(stem, MASKS_FILE))
    _check_sizes(stem, [*images.values(), *geometry.values(), *masks.values()])
    try:
        lamps = tuple(_lamp(entry) for entry in about["lamps"])
        _check_lamps(len(lamps), images, masks)
        camera = about["camera"]
        perspective = about["kind"] == "perspective"
        pinhole = camera_from_nerfstudio(camera) if perspective else None
        c2w = pinhole.c2w if pinhole else _panorama_pose(camera)
        return RenderedView(
            room=str(about["room"]),
            kind=_kind(about["kind"]),
            c2w=c2w,
            camera=pinhole,
            ambient=_rgb(images["ambient"]),
            lights=_stack([_rgb(images[f"light_{i:02d}"]) for i in range(len(lamps))], images),
            albedo=_rgb(images["albedo"]),
            normal=_rgb(geometry["normal"]),
            ray_distance_m=geometry["ray_distance_m"][..., 0],
            masks={kind: _masks(masks, kind, len(lamps)) for kind in MASK_KINDS},
            window=masks["window"][..., 0] > 0.5,
            lamps=lamps,
            exposure=positive(about["exposure"], "exposure"),
            metadata=about,
        )
    except InputError as error:
        raise FormatError(f"{stem}.json: {error}") from error
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise FormatError(f"{stem}.json and its EXR files do not agree: {error}.") from error


def save_rendered(view: RenderedView, path_stem: Path) -> int:
    """Write the four files of a view; returns how many values half precision had to clip."""
    stem = _stem(Path(path_stem))
    images = {"ambient": view.ambient}
    images |= {f"light_{i:02d}": light for i, light in enumerate(view.lights)}
    images |= {"albedo": view.albedo, "normal": view.normal}
    clipped = write_exr(_beside(stem, ".exr"), images)
    geometry = {"ray_distance_m": view.ray_distance_m, "normal": view.normal}
    write_exr(_beside(stem, ".geometry.exr"), geometry, half=False)
    masks = {
        f"{kind}_{i:02d}": mask.astype(np.float32)
        for kind in MASK_KINDS
        for i, mask in enumerate(view.masks[kind])
    }
    masks["window"] = view.window.astype(np.float32)
    write_exr(_beside(stem, MASKS_FILE), masks)
    write_json(_beside(stem, ".json"), {**_metadata(view), "clipped_values": clipped})
    return clipped


def read_metadata(path_stem: Path) -> dict[str, Any]:
    """The JSON beside a rendered view. Raises InputError or FormatError."""
    path = _beside(_stem(Path(path_stem)), ".json")
    if not path.is_file():
        raise InputError(f"{path} does not exist.")
    try:
        about = parse_json(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path} is not JSON: {error}.") from error
    if not isinstance(about, dict) or about.get("version") != COMPACT_VERSION:
        raise FormatError(f"{path} is not a rendered view of format version {COMPACT_VERSION}.")
    return about


def list_rendered(folder: Path) -> list[Path]:
    """Stems of the rendered views below a folder, in order. Raises InputError if there is none."""
    stems = sorted(p.with_suffix("") for p in Path(folder).rglob("*.json") if _is_view(p))
    if not stems:
        raise InputError(f"{folder} holds no rendered views.")
    return stems


def holds_compact(folder: Path) -> bool:
    """Whether there are rendered views of this form below a folder."""
    return folder.is_dir() and next(folder.rglob(f"*{MASKS_FILE}"), None) is not None


def as_taken(view: RenderedView) -> Float[np.ndarray, "h w 3"]:
    """The photo's light: ambient + Σ on_i · scale_i · light_i (paper, equation 1), linear."""
    return compose(view.ambient, view.lights, view.scale * view.on[:, None])


def compose(
    ambient: Float[np.ndarray, "h w 3"],
    lights: Float[np.ndarray, "m h w 3"],
    scale: Float[np.ndarray, "m 3"],
) -> Float[np.ndarray, "h w 3"]:
    """ambient + Σ scale_i · lights_i, added in the order of the lamps."""
    total = np.array(ambient, np.float32)
    for light, factor in zip(lights, scale, strict=True):
        total += np.asarray(factor, np.float32) * light
    return total


def _metadata(view: RenderedView) -> dict[str, Any]:
    """The view's own metadata, with what the fields say on top."""
    if view.camera is not None:
        camera = camera_to_nerfstudio(view.camera)
    else:
        height, width = view.ambient.shape[:2]
        matrix = view.c2w.tolist()
        position = view.c2w[:3, 3].tolist()
        yaw = float(np.degrees(np.arctan2(view.c2w[1, 0], view.c2w[0, 0])))
        camera = {
            "camera_model": "EQUIRECTANGULAR",
            "w": width,
            "h": height,
            "position": position,
            "yaw_deg": yaw,
            "transform_matrix": matrix,
        }
    known = view.metadata.get("lamps", [{}] * len(view.lamps))
    lamps = [
        {**old, **asdict(lamp), "id": i}
        for i, (old, lamp) in enumerate(zip(known, view.lamps, strict=True))
    ]
    fields = {"kind": view.kind, "camera": camera, "room": view.room, "lamps": lamps}
    return {**view.metadata, **fields, "version": COMPACT_VERSION, "exposure": view.exposure}


def _stem(path: Path) -> Path:
    for suffix in (".geometry.exr", ".masks.exr", ".exr", ".json"):
        if path.name.endswith(suffix):
            return path.with_name(path.name[: -len(suffix)])
    return path


def _beside(stem: Path, suffix: str) -> Path:
    return stem.with_name(stem.name + suffix)


def _is_view(path: Path) -> bool:
    stem = path.with_suffix("")
    return _beside(stem, ".exr").is_file() and _beside(stem, MASKS_FILE).is_file()


def _lamp(entry: dict[str, Any]) -> Lamp:
    name = str(entry["name"])
    return Lamp(
        name=name,
        kind=str(entry["kind"]),
        position=three(entry["position"], f"the position of lamp {name}"),
        power_w=finite(entry["power_w"], f"the power of lamp {name}"),
        color=three(entry["color"], f"the colour of lamp {name}"),
        on=flag(entry["on"], f"on of lamp {name}"),
        scale=three(entry["scale"], f"the scale of lamp {name}"),
    )


def _check_lamps(count: int, *files: dict[str, np.ndarray]) -> None:
    """More light or masks than lamps: what is left over would be lost without a word."""
    for layers in files:
        for name in layers:
            kind, _, number = name.rpartition("_")
            if kind in ("light", *MASK_KINDS) and number.isdecimal() and int(number) >= count:
                raise ValueError(f"layer {name} belongs to no lamp, there are {count}")


def _panorama_pose(camera: dict[str, Any]) -> np.ndarray:
    try:
        c2w = np.array(camera["transform_matrix"], float)
    except OverflowError as error:
        raise ValueError("camera c2w must be a finite 4x4 matrix") from error
    problem = pose_problem(c2w)
    if problem:
        raise ValueError(f"camera {problem}")
    return c2w


def _rgb(layer: np.ndarray) -> np.ndarray:
    if layer.shape[2] < 3:
        raise ValueError("a colour layer has fewer than 3 channels")
    return layer[..., :3].astype(np.float32)


def _stack(lights: list[np.ndarray], images: dict[str, np.ndarray]) -> np.ndarray:
    height, width = images["ambient"].shape[:2]
    return np.stack(lights) if lights else np.zeros((0, height, width, 3), np.float32)


def _masks(layers: dict[str, np.ndarray], kind: str, lamps: int) -> np.ndarray:
    height, width = layers["window"].shape[:2]
    planes = [layers[f"{kind}_{i:02d}"][..., 0] > 0.5 for i in range(lamps)]
    return np.stack(planes) if planes else np.zeros((0, height, width), bool)


def _kind(value: Any) -> str:
    if value not in ("panorama", "perspective"):
        raise ValueError(f"kind is {value!r}, neither panorama nor perspective")
    return str(value)


def _check_sizes(stem: Path, layers: list[np.ndarray]) -> None:
    if len({layer.shape[:2] for layer in layers}) != 1:
        raise FormatError(f"{stem}: its images, geometry and masks differ in size.")
