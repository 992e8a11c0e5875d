"""Rendered views written as scenes of the public layout, and scenes packed into shards of ten."""

from __future__ import annotations

import tarfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from luxcore.data.compact import Lamp, RenderedView, compose
from luxcore.data.lighting import draw_relighting
from luxcore.data.public_names import (
    BACKGROUND_PASS,
    FIRST_OLAT_PASS,
    LAMP_TYPES,
    MIX_PASSES,
    SCENE_ID,
    SCENES_PER_SHARD,
    file_name,
    meta_name,
    paint_masks,
)
from luxcore.data.public_reader import PANORAMA_FROM_BLENDER, open_scenes
from luxcore.data.rotations import quaternion_from_matrix
from luxcore.data.training import generator
from luxcore.errors import InputError
from luxcore.files.atomic import atomic_file, atomic_folder, write_json
from luxcore.files.exr import HALF_MAX, write_exr
from luxcore.files.output import check_out_folder
from luxcore.files.photos import write_png
from luxcore.light.agx import agx, srgb_encode

JPEG_QUALITY = 98
TOOL = "luxremix"
"""What `source` in the metadata of our scenes says; those of the public dataset say nothing."""

AS_TAKEN_PASS = 1
"""The mix pass that holds the photo as taken; 0 is full power, 2 and 3 are random."""

_RELIGHTING_KEY = 4
_NUMBER = "[0-9]" * 4
_SCENE_FILES = (f"{_NUMBER}.meta.json", f"{_NUMBER}.{_NUMBER}.*")


def write_scene(root: Path, scene_id: str, views: Sequence[RenderedView], *, seed: int = 0) -> Path:
    """Write all passes of a room's panoramas to `root`/`scene_id`; the folder appears whole.

    An OLAT is c_i · light_i, so the full mix is background + Σ OLAT. `seed` draws the powers and
    colours of mixes 2 and 3. Raises InputError for views of different rooms, no panoramas, or a
    folder of that name that is not ours.
    """
    _check(scene_id, views)
    folder = Path(root) / scene_id
    check_ours(folder)
    mixes = _mixes(views[0], generator(seed, _RELIGHTING_KEY, int(scene_id)))
    with atomic_folder(folder) as out:
        clipped = 0
        for number, view in enumerate(views, start=1):
            _write_geometry(out, number, view)
            clipped += _write_light(out, number, view, mixes)
        common = _common_metadata(scene_id, views, clipped)
        for number, gains in enumerate(mixes):
            _write_meta(out, number, common, [_light(v, g) for v, g in _pairs(views[0], gains)])
        dark = np.zeros((len(views[0].lamps), 3), np.float32)
        _write_meta(out, BACKGROUND_PASS, common, [_light(v, g) for v, g in _pairs(views[0], dark)])
        for lamp in range(len(views[0].lamps)):
            lighting = [_light(v, g) for v, g in _pairs(views[0], np.ones_like(dark))]
            lighting[lamp]["update"] = True
            _write_meta(out, FIRST_OLAT_PASS + lamp, common, lighting)
    return folder


def check_ours(path: Path) -> None:
    """Refuse to replace a scene's folder or a shard that this program did not write.

    Raises InputError naming `path`; one that does not exist or is an empty folder passes.
    """
    if path.suffix != ".tar":
        check_out_folder(path, _SCENE_FILES, mark=meta_name(0))
        if not (path / meta_name(0)).exists():
            return
    elif not path.exists():
        return
    try:
        tools = {scene.meta(0)["source"]["tool"] for scene in open_scenes(path)}
    except (InputError, KeyError, TypeError):
        tools = set()
    if tools != {TOOL}:
        raise InputError(f"{path} was not written by this program; name a new folder.")


def write_shards(scenes: Sequence[Path], out: Path, split: str) -> list[Path]:
    """Pack scene folders into `split`-NNNN.tar, ten consecutive ids each; same bytes every time."""
    shards = shard_members([scene.name for scene in scenes], split)
    folders = {scene.name: scene for scene in scenes}
    return [_write_shard(out / f"{n}.tar", [folders[i] for i in ids]) for n, ids in shards.items()]


def shard_members(scene_ids: Sequence[str], split: str) -> dict[str, list[str]]:
    """Which scenes go into which shard: name → ids, in order."""
    first = min((int(i) // SCENES_PER_SHARD for i in scene_ids), default=0)
    shards: dict[str, list[str]] = {}
    for scene_id in sorted(scene_ids):
        number = int(scene_id) // SCENES_PER_SHARD - first
        shards.setdefault(f"{split}-{number:04d}", []).append(scene_id)
    return shards


def _check(scene_id: str, views: Sequence[RenderedView]) -> None:
    if not SCENE_ID.fullmatch(scene_id):
        raise InputError(f"scene id {scene_id!r} must be six digits.")
    if not views:
        raise InputError(f"scene {scene_id} has no views.")
    if any(view.kind != "panorama" for view in views):
        raise InputError(f"scene {scene_id}: the public layout holds panoramas only.")
    if len({view.room for view in views}) != 1 or len({view.lamps for view in views}) != 1:
        raise InputError(f"scene {scene_id}: its views show different rooms or lamps.")


def _mixes(view: RenderedView, rng: np.random.Generator) -> list[Float[np.ndarray, "m 3"]]:
    """Factors on the OLATs for passes 0 to 3: full power, as taken, and two random ones."""
    lamps = len(view.lamps)
    mixes = [np.ones((lamps, 3), np.float32)]
    mixes.append(np.repeat(view.on[:, None], 3, axis=1).astype(np.float32))
    for _ in MIX_PASSES[2:]:
        drawn = draw_relighting(rng, lamps)
        mixes.append(drawn.gain * drawn.on[:, None])
    return mixes


def _write_geometry(out: Path, number: int, view: RenderedView) -> None:
    depth = {"depth": view.ray_distance_m}
    write_exr(out / file_name(0, number, "depth.exr"), depth, half=False)
    write_png(out / file_name(0, number, "normal.png"), view.normal * 0.5 + 0.5)
    _write_jpeg(out / file_name(0, number, "diffcol.jpg"), srgb_encode(view.albedo.clip(0, 1)))
    # Transmitted indirect light is not rendered apart here: black, as where there is no glass.
    _write_jpeg(out / file_name(0, number, "transind.jpg"), np.zeros_like(view.albedo))
    write_png(out / file_name(0, number, "lgt_obj.png"), paint_masks(view.masks["fixture"]))
    write_png(out / file_name(0, number, "lgt_src.png"), paint_masks(view.masks["emitter"]))
    write_png(out / file_name(0, number, "window.png"), view.window)


def _write_light(
    out: Path, number: int, view: RenderedView, mixes: list[Float[np.ndarray, "m 3"]]
) -> int:
    """Background, OLATs, mixes and previews; returns how many values half precision clipped."""
    olats = view.lights * view.scale[:, None, None]
    # The mixes are sums of what is stored, so that they hold for whoever reads the files.
    ambient = view.ambient.clip(-HALF_MAX, HALF_MAX).astype(np.float16).astype(np.float32)
    clipped = int(np.count_nonzero(np.abs(view.ambient) > HALF_MAX))
    for lamp, olat in enumerate(olats):
        name = file_name(FIRST_OLAT_PASS + lamp, number, "rgb_olat.exr")
        write_exr(out / name, {"olat": olat}, half=False)
        _preview(out, FIRST_OLAT_PASS + lamp, number, "olat", olat, view.exposure)
    write_exr(out / file_name(BACKGROUND_PASS, number, "rgb_bg.exr"), {"bg": _rgba(ambient)})
    _preview(out, BACKGROUND_PASS, number, "bg", ambient, view.exposure)
    for index, gains in enumerate(mixes):
        mix = compose(ambient, olats, gains)
        clipped += write_exr(out / file_name(index, number, "rgb_mix.exr"), {"mix": _rgba(mix)})
        _preview(out, index, number, "mix", mix, view.exposure)
    return clipped


def _preview(
    out: Path, pass_id: int, number: int, kind: str, linear: np.ndarray, exposure: float
) -> None:
    shown = agx((linear * np.float32(exposure)).astype(np.float32))
    write_png(out / file_name(pass_id, number, f"rgb_ldr_{kind}.png"), shown)


def _rgba(pixels: np.ndarray) -> np.ndarray:
    return np.concatenate([pixels, np.ones_like(pixels[..., :1])], axis=-1)


def _write_jpeg(path: Path, image: np.ndarray) -> None:
    from PIL import Image

    pixels = np.round(np.clip(image, 0, 1) * 255).astype(np.uint8)
    with atomic_file(path) as temporary:
        Image.fromarray(pixels).save(temporary, format="JPEG", quality=JPEG_QUALITY, subsampling=0)


def _pairs(
    view: RenderedView, gains: Float[np.ndarray, "m 3"]
) -> list[tuple[Lamp, Float[np.ndarray, " 3"]]]:
    return list(zip(view.lamps, gains, strict=True))


def _light(lamp: Lamp, gain: Float[np.ndarray, " 3"]) -> dict[str, Any]:
    """One entry of `lighting`: the colour has 1 as its largest channel, the power the rest."""
    # A lamp of 0 W still has an OLAT pass: it counts as 1 W of white there, and adds nothing.
    own = lamp.power_w * np.array(lamp.color) if lamp.power_w > 0 else np.ones(3)
    emission = own * gain
    power = float(emission.max())
    colour = emission / power if power > 0 else np.array(lamp.color) / max(lamp.color)
    return {
        "id": lamp.name,
        "power": power,
        "color": [float(c) for c in colour],
        "type": LAMP_TYPES.get(lamp.kind, lamp.kind.capitalize()),
        "colorful": bool(np.ptp(colour) > 0.5),
        "position": list(lamp.position),
        "update": False,
    }


def _common_metadata(scene_id: str, views: Sequence[RenderedView], clipped: int) -> dict[str, Any]:
    about = views[0].metadata
    height, width = views[0].ambient.shape[:2]
    centre = np.mean([view.c2w[:2, 3] for view in views], axis=0)
    lights = [
        {"light_id": lamp.name, "position": list(lamp.position), "rotation": 0.0}
        for lamp in views[0].lamps
    ]
    environment = about.get("environment") or {}
    return {
        "scene_mod": {
            "added_ifg_lights": lights,
            "added_led_signs": [],
            "room_id": int(scene_id),
            "room_center": [float(c) for c in centre],
        },
        "camera_pose": [_pose(view) for view in views],
        "blender_cfg": {
            "resolution": [width, height],
            "cam_type": "PANO",
            "fov": 360,
            "spp": about.get("spp"),
            "denoise": "OPENIMAGEDENOISE",
        },
        "envmap": {
            "id": environment.get("hdri"),
            "env_rot": float(environment.get("rotation_deg", 0.0)),
            "env_strength": float(environment.get("mean_radiance", 0.0)),
            "env_flip": False,
        },
        "source": {
            "tool": TOOL,
            "room": views[0].room,
            "exposure": views[0].exposure,
            "clipped_values": clipped,
        },
    }


def _pose(view: RenderedView) -> dict[str, Any]:
    rotation = view.c2w[:3, :3] @ PANORAMA_FROM_BLENDER
    near, far = np.quantile(view.ray_distance_m, [0.05, 0.95])
    return {
        "position": view.c2w[:3, 3].tolist(),
        "rotation": quaternion_from_matrix(rotation).tolist(),
        "fov": 360.0,
        "smpl_dist": [float(near), float(far)],
    }


def _write_meta(
    out: Path, pass_id: int, common: dict[str, Any], lighting: list[dict[str, Any]]
) -> None:
    write_json(out / meta_name(pass_id), {**common, "lighting": lighting})


def _write_shard(path: Path, scenes: list[Path]) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    ustar = tarfile.USTAR_FORMAT
    with atomic_file(path) as temporary, tarfile.open(temporary, "w", format=ustar) as tar:
        for scene in scenes:
            for file in sorted(scene.iterdir()):
                entry = tarfile.TarInfo(f"{scene.name}/{file.name}")
                entry.size, entry.mode = file.stat().st_size, 0o644
                with open(file, "rb") as stream:
                    tar.addfile(entry, stream)
    return path
