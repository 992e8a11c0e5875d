"""Structure from motion by pycolmap: SIFT on the CPU, pairs matched, views placed one by one.

The same photos and seed give the same bits on any number of threads: images enter the database
in name order before anything runs in parallel, every RANSAC is seeded, and mapping is serial.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
from typing import Any

from luxcore.capture.photo_folder import StagedPhoto
from luxcore.errors import LuxError
from luxcore.progress import Bar, progress
from luxcore.settings.capture import CaptureSettings

_BATCH = 4
_PEAK_THRESHOLD = 0.002
"""A third of COLMAP's: plain painted walls give points too (half as many again, measured)."""

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
    with _quiet(), progress("placing photos", 3 * len(photos), "steps") as bar:
        pycolmap.set_random_seed(seed)
        _import(database, images, photos)
        _extract(database, images, photos, settings, bar)
        _match(database, len(photos), settings, seed)
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


def _import(database: Path, images: Path, photos: list[StagedPhoto]) -> None:
    """One camera for all photos of one size and focal length."""
    import pycolmap

    pycolmap.Database.open(database).close()

    def lens(photo: StagedPhoto) -> tuple[int, int, float]:
        return photo.width, photo.height, photo.focal_px or 0.0

    for (width, height, focal), group in groupby(sorted(photos, key=lens), key=lens):
        options = pycolmap.ImageReaderOptions(camera_model="SIMPLE_RADIAL")
        if focal:
            options.camera_params = f"{focal},{width / 2},{height / 2},0"
        pycolmap.import_images(
            database,
            images,
            camera_mode=pycolmap.CameraMode.SINGLE,
            image_names=sorted(p.path.name for p in group),
            options=options,
        )


def _extract(
    database: Path, images: Path, photos: list[StagedPhoto], settings: CaptureSettings, bar: Bar
) -> None:
    import pycolmap

    options = pycolmap.FeatureExtractionOptions()
    options.use_gpu = False
    options.num_threads = _threads()
    options.sift.max_num_features = settings.features
    options.sift.peak_threshold = _PEAK_THRESHOLD
    names = [p.path.name for p in photos]
    for start in range(0, len(names), _BATCH):
        batch = names[start : start + _BATCH]
        pycolmap.extract_features(
            database,
            images,
            image_names=batch,
            extraction_options=options,
            device=pycolmap.Device.cpu,
        )
        bar.advance(len(batch))


def _match(database: Path, count: int, settings: CaptureSettings, seed: int) -> None:
    import pycolmap

    matching = pycolmap.FeatureMatchingOptions()
    matching.use_gpu = False
    matching.num_threads = _threads()
    verification = pycolmap.TwoViewGeometryOptions()
    verification.ransac.random_seed = seed
    common: dict[str, Any] = {
        "matching_options": matching,
        "verification_options": verification,
        "device": pycolmap.Device.cpu,
    }
    if count <= settings.exhaustive_up_to:
        pycolmap.match_exhaustive(database, **common)
    else:
        pairing = pycolmap.SequentialPairingOptions()
        pairing.overlap = settings.neighbours
        pairing.loop_detection = False
        pycolmap.match_sequential(database, pairing_options=pairing, **common)


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


def _threads() -> int:
    return max(1, len(os.sched_getaffinity(0)))


@contextmanager
def _quiet() -> Iterator[None]:
    """COLMAP writes a page of log per photo; only its errors are of interest here."""
    import pycolmap

    before = pycolmap.logging.minloglevel
    pycolmap.logging.minloglevel = 2
    try:
        yield
    finally:
        pycolmap.logging.minloglevel = before
