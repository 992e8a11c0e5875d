"""What `lux decompose` does: files in, files out, whole or not at all."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float

from luxcore.errors import InputError
from luxcore.files.atomic import atomic_folder
from luxcore.files.exr import read_exr_image
from luxcore.files.output import check_out_folder
from luxcore.files.photos import read_mask, read_photo, write_png
from luxcore.light.burning import burning_lamps
from luxcore.light.exposure import BRACKETS_EV

if TYPE_CHECKING:
    from luxcore.decompose.photo import PhotoLight
    from luxcore.models.interface import BackendSettings

MIN_SIDE_PX = 16
WRITTEN = ("ambient.exr", "light_*.exr", "lights.json", "blend.html", "pictures")


def decompose_file(
    photo_path: Path,
    mask_paths: Sequence[Path],
    off_paths: Sequence[Path],
    out: Path,
    backend: str,
    settings: BackendSettings,
    seed: int = 0,
) -> dict[str, Any]:
    """Decompose a photo file (or a linear EXR) into the folder `out`; see `lux decompose`.

    Raises InputError or FormatError for files that cannot be used; `out` is then left as it was.
    """
    from luxcore.models.backends import check_weights, open_decomposer

    check_out_folder(out, WRITTEN, mark="lights.json")
    check_weights(backend, settings.sv_weights)
    shown, linear = _read(photo_path)
    masks, names, off = _masks(shown, mask_paths, off_paths)
    from luxcore.decompose.photo import decompose_photo

    with atomic_folder(out) as folder:
        on = burning_lamps(linear, masks) & ~off
        model = open_decomposer(backend, settings)
        result = decompose_photo(linear, masks, model, on=on, seed=seed)
        _write(folder, shown, result, names)
    return {
        "out": str(out),
        "recomposition_db": round(result.recomposition_db, 2),
        "lamps": [
            {"name": name, "on": bool(lit), "scale": scale}
            for name, lit, scale in zip(
                names, result.on, result.light.scale.astype(float).tolist(), strict=True
            )
        ],
    }


def parse_options(texts: Sequence[str]) -> dict[str, str | int | float | bool]:
    """NAME=VALUE texts as options; numbers, true and false are taken as such."""
    options: dict[str, str | int | float | bool] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise InputError(f"an option must look like NAME=VALUE, got {text!r:.80}.")
        options[name] = _plain(value)
    return options


def _plain(value: str) -> str | int | float | bool:
    if value.lower() in ("true", "false"):
        return value.lower() == "true"
    for kind in (int, float):
        try:
            return kind(value)
        except ValueError:
            continue
    return value


def _read(path: Path) -> tuple[Float[np.ndarray, "h w 3"], Float[np.ndarray, "h w 3"]]:
    """The photo as displayed and in linear light where the exposure is 1."""
    is_linear = path.suffix.lower() == ".exr"
    pixels = np.maximum(read_exr_image(path), 0) if is_linear else read_photo(path)
    height, width = pixels.shape[:2]
    if min(height, width) < MIN_SIDE_PX:
        raise InputError(f"{path} is {width}x{height}; {MIN_SIDE_PX} pixels a side are the least.")
    # Only now, as loading it takes longer than finding out that a file cannot be used.
    from luxcore.light.agx import agx, agx_inverse

    if is_linear:
        return np.asarray(agx(pixels), np.float32), pixels
    return pixels, np.asarray(agx_inverse(pixels), np.float32)


def _masks(
    shown: Float[np.ndarray, "h w 3"], mask_paths: Sequence[Path], off_paths: Sequence[Path]
) -> tuple[Bool[np.ndarray, "k h w"], list[str], Bool[np.ndarray, " k"]]:
    """All masks in order, their names, and which lamps the user calls off."""
    height, width = shown.shape[:2]
    paths = [*mask_paths, *off_paths]
    if not paths:
        from luxcore.masks.single import propose_photo

        found = propose_photo(shown)
        return np.stack(found), [f"lamp_{k}" for k in range(len(found))], np.zeros(len(found), bool)
    masks = np.stack([read_mask(path, (height, width)) for path in paths])
    _check_part_of_photo(paths, masks)
    _check_overlap(paths, masks)
    off = np.arange(len(paths)) >= len(mask_paths)
    return masks, [path.stem for path in paths], off


def _check_part_of_photo(paths: Sequence[Path], masks: Bool[np.ndarray, "k h w"]) -> None:
    for path, mask in zip(paths, masks, strict=True):
        if mask.all():
            raise InputError(f"{path} covers the whole photo: draw the lamp alone, white on black.")


def _check_overlap(paths: Sequence[Path], masks: Bool[np.ndarray, "k h w"]) -> None:
    """Masks that touch are fine (the first owns the shared pixels); one lamp given twice is not."""
    for second in range(len(masks)):
        for first in range(second):
            shared = int((masks[first] & masks[second]).sum())
            if shared > 0.5 * min(int(masks[first].sum()), int(masks[second].sum())):
                raise InputError(
                    f"{paths[second]} and {paths[first]} overlap by more than half: "
                    "give each lamp its own mask."
                )


def _write(
    folder: Path, shown: Float[np.ndarray, "h w 3"], result: PhotoLight, names: Sequence[str]
) -> None:
    from luxcore.decompose.store import write_light
    from luxcore.explorer import write_explorer
    from luxcore.light.agx import agx

    light = result.light
    write_light(folder, result, names, 1.0, np.ones(len(names), bool))
    for k, lamp in enumerate(light.contributions()):
        for ev in BRACKETS_EV:
            picture = agx(lamp * np.float32(2.0**ev))
            write_png(folder / "pictures" / f"light_{k:02d}_ev{abs(ev):g}.png", picture)
        if result.on[k]:
            write_png(folder / "pictures" / f"without_{k:02d}.png", agx(light.one_light_off(k)))
    write_explorer(
        folder / "blend.html", shown, light.ambient, light.olat, light.scale, list(names), 1.0
    )
