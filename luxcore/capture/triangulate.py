"""Points for views whose poses are known but that came without any."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from luxcore.cameras import Camera
from luxcore.capture.colmap_files import read_points3d
from luxcore.capture.features import extract_features, match_features, quiet
from luxcore.capture.photo_folder import StagedPhoto
from luxcore.capture.points import Points
from luxcore.progress import progress
from luxcore.settings.capture import CaptureSettings


def triangulate(
    photos: Sequence[StagedPhoto],
    cameras: Sequence[Camera],
    work: Path,
    settings: CaptureSettings,
    seed: int,
) -> Points:
    """Match the staged photos and intersect their rays; poses and intrinsics stay as they are."""
    import pycolmap

    images, database = photos[0].path.parent, work / "features.db"
    with quiet(), progress("finding points", 2 * len(photos), "steps") as bar:
        pycolmap.set_random_seed(seed)
        pycolmap.Database.open(database).close()
        pycolmap.import_images(
            database,
            images,
            camera_mode=pycolmap.CameraMode.PER_IMAGE,
            image_names=[p.path.name for p in photos],
            options=pycolmap.ImageReaderOptions(camera_model="PINHOLE"),
        )
        model = _known_model(database, photos, cameras)
        extract_features(database, images, list(photos), settings, bar)
        match_features(database, len(photos), settings, seed)
        options = pycolmap.IncrementalPipelineOptions()
        for part in (options, options.mapper, options.triangulation):
            part.random_seed = seed
        options.num_threads = options.mapper.num_threads = 1
        (work / "model").mkdir()
        pycolmap.triangulate_points(model, database, images, work / "model", options=options)
        bar.advance(len(photos))
    return read_points3d(work / "model")


def _known_model(database: Path, photos: Sequence[StagedPhoto], cameras: Sequence[Camera]) -> Any:
    """A reconstruction with the database's numbers; the true intrinsics go into both."""
    import pycolmap

    model = pycolmap.Reconstruction()
    with pycolmap.Database.open(database) as opened:
        rows = {image.name: image for image in opened.read_all_images()}
        for photo, camera in zip(photos, cameras, strict=True):
            row = rows[photo.path.name]
            lens = opened.read_camera(row.camera_id)
            lens.params = [camera.fx, camera.fy, camera.cx, camera.cy]
            lens.has_prior_focal_length = True
            opened.update_camera(lens)
            model.add_camera_with_trivial_rig(lens)
            image = pycolmap.Image(name=row.name, camera_id=row.camera_id, image_id=row.image_id)
            pose = pycolmap.Rigid3d(np.ascontiguousarray(camera.viewmat[:3]))
            model.add_image_with_trivial_frame(image, pose)
    return model
