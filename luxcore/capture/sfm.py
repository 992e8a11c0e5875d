"""Structure from motion by pycolmap: SIFT on the CPU, pairs matched, views placed one by one.

The same photos and seed give the same bits on any number of threads: see `features`, and mapping
is serial.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from luxcore.capture.features import extract_features, import_photos, match_features, quiet
from luxcore.capture.photo_folder import StagedPhoto
from luxcore.errors import LuxError
from luxcore.progress import Bar, progress
from luxcore.settings.capture import CaptureSettings

_SHOWN = 6


def solve_poses(
    photos: list[StagedPhoto], work: Path, settings: CaptureSettings, seed: int
) -> Path:
    """Folder of the COLMAP model that places most of the staged photos.

    Image names in the model are those of the staged files.
    Raises LuxError saying how many of how many were placed when they are too few.
    """
    import pycolmap

    images, database = photos[0].path.parent, work / "features.db"
    with quiet(), progress("placing photos", 3 * len(photos), "steps") as bar:
        pycolmap.set_random_seed(seed)
        import_photos(database, images, photos)
        extract_features(database, images, photos, settings, bar)
        match_features(database, len(photos), settings, seed)
        bar.advance(len(photos))
        models = _map(database, images, work / "models", seed, bar)
    sizes = {i: m.num_reg_images() for i, m in models.items()}
    best = max(sizes, key=lambda i: (sizes[i], -i), default=None)
    placed = set() if best is None else {i.name for i in models[best].images.values()}
    _check_placed(photos, placed, settings)
    return work / "models" / str(best)


def _check_placed(photos: list[StagedPhoto], placed: set[str], settings: CaptureSettings) -> None:
    needed = max(settings.min_views, settings.min_placed * len(photos))
    if len(placed) >= needed:
        return
    missing = [p.name for p in photos if p.path.name not in placed]
    shown = ", ".join(missing[:_SHOWN]) + (
        f" and {len(missing) - _SHOWN} more" if len(missing) > _SHOWN else ""
    )
    raise LuxError(
        f"only {len(placed)} of {len(photos)} views could be placed (not {shown}): take more "
        "photos from places half a step apart, so that each shows at least two thirds of what "
        "its neighbour shows."
    )


def _map(database: Path, images: Path, out: Path, seed: int, bar: Bar) -> dict[int, Any]:
    import pycolmap

    out.mkdir()
    options = pycolmap.IncrementalPipelineOptions()
    options.min_model_size = 3
    for part in (options, options.mapper, options.triangulation):
        part.random_seed = seed
    # More threads change the order of sums in bundle adjustment and with it the last bits.
    options.num_threads = options.mapper.num_threads = 1
    return pycolmap.incremental_mapping(
        database, images, out, options, next_image_callback=lambda: bar.advance(1)
    )
