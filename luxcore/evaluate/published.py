"""Scores of a model on real photos against what others published for them.

There is no truth here, but a yardstick: OLATs by LuxRemix's authors, and LightLab's photo of two
lamps in 7 × 7 colours, whose colours are fitted on the first row and column; the other 36 pictures
are predicted.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from luxcore.decompose.photo import PhotoLight, decompose_photo
from luxcore.errors import InputError
from luxcore.evaluate.table import Row, mean_row, write_table
from luxcore.files.exr import read_exr_image
from luxcore.files.photos import list_photos, read_mask, read_photo, write_png
from luxcore.light.agx import agx, agx_inverse
from luxcore.masks.single import propose_photo
from luxcore.metrics.score import score_display, score_pair, shown_scale
from luxcore.models.interface import Decomposer

GRID_SIDE = 7
GRID_PHOTO = (1, 1)
"""Row and column of the picture that is taken apart: both lamps nearly white."""

Image = Float[np.ndarray, "h w 3"]


@dataclass(frozen=True)
class Published:
    """A photo, its masks, and the authors' light of each lamp at the photo's size."""

    name: str
    photo: Image
    masks: np.ndarray
    olats: list[Image]


def read_published(folder: Path) -> Published:
    """One folder of the authors' web demo. Raises InputError naming what is missing."""
    inputs = sorted(folder.glob("input.*"))
    masks, olats = list_photos(folder / "mask"), sorted((folder / "ours").glob("olat_*.exr"))
    if not inputs or not masks or len(masks) != len(olats):
        raise InputError(f"{folder} must hold input.*, and as many masks as ours/olat_*.exr.")
    photo = read_photo(inputs[0])
    height, width = photo.shape[:2]
    planes = np.stack([read_mask(mask, (height, width)) for mask in masks])
    images = [_resized(read_exr_image(olat)[..., :3], (height, width)) for olat in olats]
    return Published(folder.name, photo, planes, images)


def compare_olats(shown: Published, decomposer: Decomposer, out: Path) -> dict[str, list[dict]]:
    """Scores of our light and of copying the photo, against the authors' light of each lamp."""
    linear = agx_inverse(shown.photo).astype(np.float32)
    result = decompose_photo(linear, shown.masks, decomposer)
    scores: dict[str, list[dict]] = {"copy the input": [], decomposer.name: []}
    rows = []
    for lamp, theirs in enumerate(shown.olats):
        ours = result.light.olat[lamp]
        scores["copy the input"].append(score_pair(linear, theirs, 1.0))
        scores[decomposer.name].append(score_pair(ours, theirs, 1.0))
        scaled = agx((ours * shown_scale(ours, theirs, 1.0)).astype(np.float32))
        mask = np.repeat(shown.masks[lamp][..., None], 3, 2).astype(np.float32)
        rows.append(np.concatenate([shown.photo, mask, scaled, agx(theirs)], axis=1))
    write_png(out / f"olats_{shown.name}.png", np.concatenate(rows))
    scores["recomposition"] = [{"psnr": result.recomposition_db}]
    return scores


def compare_grid(folder: Path, decomposer: Decomposer, out: Path) -> dict[str, list[dict]]:
    """Scores over the 36 pictures of the grid that no colour was fitted on.

    "sum of pictures" adds what row and column changed, which needs three pictures for each.
    """
    grid = _read_grid(folder)
    masks = _left_and_right(grid[GRID_PHOTO])
    linear = {place: agx_inverse(picture).astype(np.float32) for place, picture in grid.items()}
    result = decompose_photo(linear[GRID_PHOTO], masks, decomposer, on=np.ones(2, bool))
    left = [_gains(result, linear[r, 0])[0] for r in range(GRID_SIDE)]
    right = [_gains(result, linear[0, c])[1] for c in range(GRID_SIDE)]
    asked = list(itertools.product(range(1, GRID_SIDE), repeat=2))
    scores: dict[str, list[dict]] = {"copy the input": [], "sum of pictures": [], "ours": []}
    for r, c in asked:
        ours = result.light.ambient + np.einsum(
            "kc,khwc->hwc", np.stack([left[r], right[c]]), result.light.olat
        )
        added = np.maximum(linear[r, 0] + linear[0, c] - linear[0, 0], 0)
        for name, picture in (("sum of pictures", agx(added)), ("ours", agx(ours))):
            scores[name].append(score_display(picture, grid[r, c]))
        scores["copy the input"].append(score_display(grid[GRID_PHOTO], grid[r, c]))
        if r == c:
            pair = np.concatenate([grid[GRID_PHOTO], agx(ours), grid[r, c]], axis=1)
            write_png(out / f"grid_{r}_{c}.png", pair)
    return {decomposer.name if name == "ours" else name: s for name, s in scores.items()}


def _left_and_right(photo: Image) -> np.ndarray:
    """Masks of the most lamp-like region of either half: rows of the grid colour the left lamp,
    columns the right one."""
    left = np.arange(photo.shape[1]) < photo.shape[1] // 2
    halves = [np.where(side[None, :, None], photo, 0) for side in (left, ~left)]
    return np.stack([propose_photo(half.astype(np.float32))[0] for half in halves])


def _gains(result: PhotoLight, target: Image) -> Float[np.ndarray, "k 3"]:
    """RGB factors of the lamps that best turn the photo into `target`; ambient stays."""
    from luxcore.light.scale_factors import solve

    return solve(target, result.light.ambient, result.light.olat)


def _read_grid(folder: Path) -> dict[tuple[int, int], Image]:
    places = itertools.product(range(GRID_SIDE), repeat=2)
    return {(r, c): read_photo(folder / f"{r}_{c}.jpg") for r, c in places}


def _resized(image: Image, size: tuple[int, int]) -> Image:
    import cv2

    return cv2.resize(image, (size[1], size[0]), interpolation=cv2.INTER_AREA)


def _rows(scores: dict[str, list[dict]], label: str) -> list[Row]:
    return [mean_row(name, label, values) for name, values in scores.items()]


def real_photo_rows(
    olats: Sequence[Path], grid: Path | None, decomposer: Decomposer, out: Path
) -> list[Row]:
    """Rows of the table; side-by-side pictures go into `out`."""
    rows = []
    for folder in olats:
        rows += _rows(compare_olats(read_published(folder), decomposer, out), folder.name)
    if grid is not None:
        rows += _rows(compare_grid(grid, decomposer, out), "LightLab grid")
    write_table(out, "real_photos", "Real photos, against others' answers", rows, {})
    return rows
