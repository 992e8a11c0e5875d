"""The fuse stage for one capture: linear HDR light of every view.

Taken from the model where it gives linear light, which is as exact as merging its exposures; these
are then merged in some views only, to be compared. Or merged in all views, as the paper does.
"""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any, assert_never

import numpy as np
from jaxtyping import Float

from luxcore.capture import Capture
from luxcore.errors import FormatError, InputError
from luxcore.files.atomic import write_json
from luxcore.files.digests import file_digest
from luxcore.files.exr import HALF_MAX, read_exr, write_exr
from luxcore.files.photos import read_photo
from luxcore.light.hdr import Merged, merge_brackets
from luxcore.settings.fuse import FuseSettings, Method
from luxcore.units import Executor, Unit, UnitStore, run_units, unit_key

CODE = ("luxcore/light", "luxcore/files")
"""Code whose change makes finished views stale."""

_BRACKET = re.compile(r"(?P<view>\d{4})_(?P<light>ambient|\d{2})_ev(?P<stops>\d+)\.png")
_COUNTS = ("clipped", "black", "gaps", "unknown", "disagreeing")


def fuse_capture(
    harmonize_dir: Path,
    capture: Capture,
    out: Path,
    settings: FuseSettings,
    store: UnitStore,
    executor: Executor | None = None,
) -> dict[str, float]:
    """Write `NNNN.exr` (ambient, light_00, …, float32) of every view and `fuse.json` into `out`.

    Returns flat metrics: shares of pixels that were clipped, black, between two exposures, unknown
    or contradictory in the exposures that were merged, and the median relative difference to the
    model's own linear light.
    Raises InputError or FormatError naming a missing or unfit file.
    """
    exposure = capture.exposure or 1.0
    units = [
        _unit(Path(harmonize_dir), capture.id, view, exposure, settings)
        for view in range(len(capture.frames))
    ]
    result = run_units(units, store, executor, label=f"fuse {capture.id}")
    Path(out).mkdir(parents=True, exist_ok=True)
    records = []
    for view, unit in enumerate(units):
        folder = result.folders[unit.name]
        shutil.copyfile(folder / "fused.exr", Path(out) / f"{view:04d}.exr")
        records.append(json.loads((folder / "counts.json").read_text(encoding="utf-8")))
    summary = _summary(records)
    about = {"method": settings.method, "exposure": capture.exposure, **summary}
    write_json(Path(out) / "fuse.json", about)
    return summary


def fuse_view(
    out_dir: Path, *, harmonize_dir: str, view: int, exposure: float, method: Method, merge: bool
) -> None:
    """One view as a unit of work: `fused.exr` and `counts.json`; `merge`: its exposures too."""
    root = Path(harmonize_dir)
    counts = dict.fromkeys((*_COUNTS, "pixels"), 0)
    difference: list[float] = []
    layers: dict[str, np.ndarray] = {}
    for name, linear in _direct(root, view).items():
        if not merge:
            layers[name] = np.maximum(linear, 0.0)
            continue
        merged = merge_files(bracket_paths(root, view, name), exposure)
        if merged.radiance.shape != linear.shape:
            raise FormatError(f"{root}: view {view}'s exposures and linear light differ in size.")
        for count in _COUNTS:
            counts[count] += getattr(merged, count)
        counts["pixels"] += linear[..., 0].size
        difference.append(median_difference(merged.radiance, linear, exposure))
        layers[name] = np.maximum(_chosen(method, merged.radiance, linear), 0.0)
    write_exr(out_dir / "fused.exr", layers, half=False)
    beyond_half = sum(int((layer > HALF_MAX).sum()) for layer in layers.values())
    record = {**counts, "beyond_half": beyond_half, "difference": difference}
    write_json(out_dir / "counts.json", record)


def _chosen(method: Method, merged: np.ndarray, direct: np.ndarray) -> np.ndarray:
    match method:
        case "debevec":
            return merged
        case "direct":
            return direct
        case _:
            assert_never(method)


def bracket_paths(root: Path, view: int, name: str) -> dict[int, Path]:
    """The exposures of one light of one view, by stops darker than EV 0.

    `root` is a folder of the stage harmonize. Raises InputError where it holds none.
    """
    wanted = name.removeprefix("light_")
    paths = {}
    for path in sorted((root / "brackets").glob(f"{view:04d}_{wanted}_ev*.png")):
        match = _BRACKET.fullmatch(path.name)
        if match:
            paths[int(match["stops"])] = path
    if not paths:
        raise InputError(f"{root / 'brackets'} holds no exposures of {name} in view {view}.")
    return paths


def merge_files(paths: dict[int, Path], exposure: float) -> Merged:
    """Merge pictures AgX(2^-stops · exposure · I) given by stops."""
    stops = sorted(paths)
    return merge_brackets(
        [read_photo(paths[s]) for s in stops], [-float(s) for s in stops], exposure=exposure
    )


def median_difference(
    merged: Float[np.ndarray, "h w 3"], direct: Float[np.ndarray, "h w 3"], exposure: float
) -> float:
    """Median over lit pixels of |merged − direct| / direct; 0 where nothing is lit."""
    lit = direct * exposure > 1e-2
    if not lit.any():
        return 0.0
    return float(np.median(np.abs(merged[lit] / direct[lit] - 1)))


def _unit(root: Path, capture_id: str, view: int, exposure: float, settings: FuseSettings) -> Unit:
    files = [root / "direct" / f"{view:04d}.exr"]
    merge = settings.method == "debevec" or view % settings.merge_every == 0
    if merge:
        files += sorted((root / "brackets").glob(f"{view:04d}_*.png"))
    if not files[0].is_file():
        raise InputError(f"{files[0]} does not exist.")
    about: dict[str, Any] = {
        "exposure": exposure,
        "method": settings.method,
        "view": view,
        "merge": merge,
    }
    names = [f.name for f in files]
    key = unit_key(CODE, {**about, "files": names}, [file_digest(f) for f in files])
    arguments = {"harmonize_dir": str(root), **about}
    return Unit(f"{capture_id} view {view}", "luxcore.light.fuse:fuse_view", arguments, key)


def _direct(root: Path, view: int) -> dict[str, np.ndarray]:
    path = root / "direct" / f"{view:04d}.exr"
    layers = {name: pixels[..., :3] for name, pixels in read_exr(path).items()}
    if "ambient" not in layers:
        raise FormatError(f"{path} lacks the part ambient.")
    return layers


def _summary(records: list[dict[str, Any]]) -> dict[str, float]:
    pixels = max(1, sum(record["pixels"] for record in records))
    summary = {f"{name}_share": sum(r[name] for r in records) / pixels for name in _COUNTS}
    differences = [value for record in records for value in record["difference"]]
    return {
        **summary,
        "beyond_half": float(sum(record["beyond_half"] for record in records)),
        "median_difference_to_direct": float(np.median(differences)) if differences else 0.0,
    }
