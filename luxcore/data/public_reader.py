"""Public scenes as rendered views. Views and passes are inferred from the file names."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from luxcore.data.compact import Lamp, RenderedView
from luxcore.data.public_files import FolderFiles, TarFiles, find_scenes
from luxcore.data.public_names import (
    BACKGROUND_PASS,
    FILE_NAME,
    FIRST_OLAT_PASS,
    LAMP_TYPES,
    MIX_PASSES,
    file_name,
    meta_name,
    pick_mask,
)
from luxcore.data.rotations import matrix_from_quaternion
from luxcore.errors import FormatError, InputError
from luxcore.files.exr import read_exr
from luxcore.files.json_numbers import finite, parse_json, positive, three
from luxcore.files.photos import read_photo
from luxcore.light.agx import srgb_decode
from luxcore.light.exposure import estimate_exposure
from luxcore.render.masks import convex_hull

MAX_META_BYTES = 4_000_000
PANORAMA_FROM_BLENDER = np.array([[0.0, 0, -1], [-1, 0, 0], [0, 1, 0]])
"""Blender's camera axes (x right, y up, −z forward) in ours for a panorama (x forward, z up)."""

_KINDS = {word: kind for kind, word in LAMP_TYPES.items()}


@dataclass(frozen=True)
class PublicScene:
    """One scene; nothing is read before it is asked for."""

    files: FolderFiles | TarFiles

    @property
    def scene_id(self) -> str:
        """Six digits."""
        return self.files.scene_id

    @cached_property
    def _index(self) -> list[tuple[int, int | None]]:
        matches = [FILE_NAME.fullmatch(name) for name in self.files.names()]
        return [(int(m["pass"]), int(m["view"]) if m["view"] else None) for m in matches if m]

    @property
    def views(self) -> list[int]:
        """The views that exist, from 1 on; most scenes have four, some fewer."""
        return sorted({view for _, view in self._index if view is not None})

    @property
    def olat_passes(self) -> list[int]:
        """One per room lamp, from 1001 on."""
        return sorted({number for number, _ in self._index if number >= FIRST_OLAT_PASS})

    @property
    def mix_passes(self) -> list[int]:
        """0 is all lamps at full power; 1 to 3 are mixes."""
        return sorted({number for number, _ in self._index if number in MIX_PASSES})

    def meta(self, pass_id: int) -> dict[str, Any]:
        """A pass's metadata. Raises FormatError."""
        name = meta_name(pass_id)
        with self.files.open_path(name) as path:
            if path.stat().st_size > MAX_META_BYTES:
                raise FormatError(f"{self._where(name)} is too large for metadata.")
            try:
                about = parse_json(path.read_text(encoding="utf-8"))
            except (ValueError, RecursionError) as error:
                raise FormatError(f"{self._where(name)} is not JSON: {error}.") from error
        if not isinstance(about, dict):
            raise FormatError(f"{self._where(name)} is not a JSON object.")
        return about

    def exr(self, pass_id: int, view: int, kind: str) -> Float[np.ndarray, "h w c"]:
        """The pixels of an EXR, such as kind "rgb_olat.exr"; RGB or one channel."""
        with self.files.open_path(file_name(pass_id, view, kind)) as path:
            pixels = next(iter(read_exr(path).values()))
        pixels = pixels[..., :3] if pixels.shape[2] >= 3 else pixels[..., :1]
        if not np.isfinite(pixels).all():
            where = self._where(file_name(pass_id, view, kind))
            raise FormatError(f"{where} has values that are not finite.")
        return pixels

    def picture(self, pass_id: int, view: int, kind: str) -> Float[np.ndarray, "h w 3"]:
        """An 8-bit picture in 0..1."""
        with self.files.open_path(file_name(pass_id, view, kind)) as path:
            return read_photo(path)

    def read_view(self, view: int, mix: int = 0) -> RenderedView:
        """A view with every lamp, in the powers and colours of mix pass `mix`.

        `lights[i]` is the stored OLAT of pass 1001 + i, `scale[i]` its factor in the mix from the
        two passes' powers and colours. Raises InputError for a view that does not exist,
        FormatError for files that do not fit.
        """
        if view not in self.views:
            raise InputError(f"scene {self.scene_id} has no view {view}, only {self.views}.")
        try:
            return self._read(view, mix)
        except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
            raise FormatError(
                f"{self._root}: scene {self.scene_id} view {view} does not fit the public layout: "
                f"{error!r}."
            ) from error

    def _read(self, view: int, mix: int) -> RenderedView:
        about = self.meta(mix)
        ambient = self.exr(BACKGROUND_PASS, view, "rgb_bg.exr")
        size = ambient.shape[:2]
        metas = [self.meta(number) for number in self.olat_passes]
        lights = [self.exr(number, view, "rgb_olat.exr") for number in self.olat_passes]
        lamps = tuple(_lamp(meta, about) for meta in metas)
        distance = self.exr(0, view, "depth.exr")[..., 0]
        images = [*lights, distance]
        if any(image.shape[:2] != size for image in images):
            raise ValueError("its images differ in size")
        emitter, fixture = (self._masks(view, kind, metas, size) for kind in ("lgt_src", "lgt_obj"))
        fixture |= emitter
        stack = np.stack(lights) if lights else np.zeros((0, *size, 3), np.float32)
        source = about.get("source", {})
        exposure = source.get("exposure")
        mixed = ambient + np.einsum("mc,mhwc->hwc", _scales(lamps), stack)
        return RenderedView(
            room=str(source.get("room", self.scene_id)),
            kind="panorama",
            c2w=self._pose(about, view),
            camera=None,
            ambient=ambient,
            lights=stack,
            albedo=srgb_decode(self.picture(0, view, "diffcol.jpg")),
            normal=self.picture(0, view, "normal.png") * 2 - 1,
            ray_distance_m=distance,
            masks={
                "emitter": emitter,
                "fixture": fixture,
                "hull": np.array([convex_hull(m, True) for m in fixture], bool).reshape(
                    len(fixture), *size
                ),
            },
            window=self.picture(0, view, "window.png")[..., 0] > 0.5,
            lamps=lamps,
            exposure=estimate_exposure(mixed)
            if exposure is None
            else positive(exposure, "exposure"),
            metadata={"scene": self.scene_id, "view": view, **_kept(about)},
        )

    def _masks(
        self, view: int, kind: str, metas: list[dict], size: tuple[int, ...]
    ) -> Bool[np.ndarray, "m h w"]:
        picture = self.picture(0, view, f"{kind}.png")
        if picture.shape[:2] != tuple(size):
            raise ValueError(f"{kind}.png differs in size")
        planes = [pick_mask(picture, _active(meta), len(meta["lighting"])) for meta in metas]
        return np.array(planes, bool).reshape(len(metas), *size)

    def _pose(self, about: dict[str, Any], view: int) -> Float[np.ndarray, "4 4"]:
        pose = about["camera_pose"][self.views.index(view)]
        c2w = np.eye(4)
        w, x, y, z = (finite(value, "the rotation of a camera") for value in pose["rotation"])
        blender = matrix_from_quaternion(np.array([w, x, y, z]))
        c2w[:3, :3] = blender @ PANORAMA_FROM_BLENDER.T
        c2w[:3, 3] = three(pose["position"], "the position of a camera")
        return c2w

    @property
    def _root(self) -> Path:
        return self.files.shard if isinstance(self.files, TarFiles) else self.files.folder

    def _where(self, name: str) -> str:
        return f"{self._root}: {self.scene_id}/{name}"


def open_scenes(path: Path) -> list[PublicScene]:
    """The scenes of a shard, of a scene folder, or of a folder of either. Raises InputError."""
    return [PublicScene(files) for files in find_scenes(path)]


@dataclass(frozen=True)
class PublicView:
    """One view of a public scene, to be sampled from: read from its shard when first needed."""

    scene: PublicScene
    view: int
    mix: int = 0

    @property
    def room(self) -> str:
        """The scene's id: a scene is one room."""
        return self.scene.scene_id

    def load(self) -> RenderedView:
        """Read it."""
        return self.scene.read_view(self.view, self.mix)


def public_views(path: Path) -> list[PublicView]:
    """All views of the scenes at `path`, at full power; nothing is unpacked."""
    return [PublicView(scene, view) for scene in open_scenes(path) for view in scene.views]


def _active(meta: dict[str, Any]) -> int:
    """Index of the light that an OLAT pass turns on."""
    active = [i for i, light in enumerate(meta["lighting"]) if light.get("update")]
    if len(active) != 1:
        raise ValueError(f"an OLAT pass turns on {len(active)} lights instead of one")
    return active[0]


def _lamp(olat: dict[str, Any], mix: dict[str, Any]) -> Lamp:
    """A lamp as the OLAT pass has it, with the factor that the mix applies to it."""
    entry = olat["lighting"][_active(olat)]
    name, kind = str(entry["id"]), str(entry["type"])
    mixed = next((light for light in mix["lighting"] if light["id"] == entry["id"]), None)
    if mixed is None:
        raise ValueError(f"the mix lists no lamp {name}")
    own, wanted = _emission(entry), _emission(mixed)
    scale = np.divide(wanted, own, out=np.zeros(3), where=own > 0)
    return Lamp(
        name=name,
        kind=_KINDS.get(kind, kind.lower()),
        position=three(entry["position"], f"the position of lamp {name}"),
        power_w=finite(mixed["power"], f"the power of lamp {name}"),
        color=three(mixed["color"], f"the colour of lamp {name}"),
        on=bool((scale > 0).any()),
        scale=three(scale.tolist(), f"the scale of lamp {name}"),
    )


def _emission(light: dict[str, Any]) -> Float[np.ndarray, " 3"]:
    return finite(light["power"], "a power") * np.array(three(light["color"], "a colour"))


def _scales(lamps: tuple[Lamp, ...]) -> Float[np.ndarray, "m 3"]:
    return np.array([lamp.scale for lamp in lamps], np.float32).reshape(-1, 3)


def _kept(about: dict[str, Any]) -> dict[str, Any]:
    return {k: about[k] for k in ("blender_cfg", "envmap", "scene_mod", "source") if k in about}
