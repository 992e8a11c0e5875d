"""Features of photos and their matches in a COLMAP database, the same on any number of threads.

Images enter the database in name order before anything runs in parallel, and RANSAC is seeded.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
from typing import Any

from luxcore.capture.photo_folder import StagedPhoto
from luxcore.progress import Bar
from luxcore.settings.capture import CaptureSettings

_BATCH = 4
_PEAK_THRESHOLD = 0.002
"""A third of COLMAP's: plain painted walls give points too (half as many again, measured)."""


def import_photos(database: Path, images: Path, photos: list[StagedPhoto]) -> None:
    """Into a new database: one camera for all photos of one size and focal length."""
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


def extract_features(
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


def match_features(database: Path, count: int, settings: CaptureSettings, seed: int) -> None:
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


def _threads() -> int:
    return max(1, len(os.sched_getaffinity(0)))


@contextmanager
def quiet() -> Iterator[None]:
    """COLMAP writes a page of log per photo; only its errors are of interest here."""
    import pycolmap

    before = pycolmap.logging.minloglevel
    pycolmap.logging.minloglevel = 2
    try:
        yield
    finally:
        pycolmap.logging.minloglevel = before
