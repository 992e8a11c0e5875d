"""Lamps of a capture, found without anyone's help."""

from __future__ import annotations

import math

import numpy as np

from luxcore.cameras import Camera
from luxcore.capture.depth_points import pixel_rays
from luxcore.capture.store import Capture
from luxcore.errors import LuxError
from luxcore.files.photos import read_photo
from luxcore.masks.blobs import Blob, find_blobs
from luxcore.masks.grouping import Group, ViewBlobs, extent, group_blobs, view_blobs
from luxcore.masks.growing import grow_mask
from luxcore.masks.lampness import lampness, needed
from luxcore.masks.merging import add_pieces, merge_pieces
from luxcore.masks.references import best_views, photo_sharpness
from luxcore.masks.single import full_mask
from luxcore.masks.store import FoundLamp, Mask
from luxcore.progress import progress
from luxcore.settings.masks import MasksSettings

CANDIDATES = 3
"""Groups looked at per lamp that may be kept: pieces are joined and weak ones dropped later."""


def propose_lamps(capture: Capture, settings: MasksSettings) -> list[FoundLamp]:
    """At most `settings.max_lamps` lamps that shine in the photos, surest first.

    Raises LuxError when the photos show none.
    """
    views: list[ViewBlobs] = []
    sharpness: dict[int, float] = {}
    with progress("looking for lamps", len(capture.frames), "views") as bar:
        for index, frame in enumerate(capture.frames):
            photo = read_photo(frame.image_path)
            sharpness[index] = photo_sharpness(photo)
            blobs = find_blobs(photo, settings.min_area, settings.max_area)
            scores = [lampness(b, elevation_deg(b, frame.camera)) for b in blobs]
            views.append(view_blobs(frame.camera, blobs, scores))
            bar.advance(1)
    groups = _lamp_groups(views, settings)
    lamps: list[FoundLamp] = []
    for group in groups:
        masks = _masks(capture, group, views)
        references = best_views(masks, sharpness, settings.references)
        lamps.append(FoundLamp(f"lamp_{len(lamps)}", True, masks, references))
    return lamps


def elevation_deg(blob: Blob, camera: Camera) -> float:
    """Angle above the horizon under which the camera sees the region (world z is up)."""
    u, v = blob.centre[0] * camera.width, blob.centre[1] * camera.height
    return math.degrees(math.asin(pixel_rays(camera, np.array(u), np.array(v))[2]))


def _lamp_groups(views: list[ViewBlobs], settings: MasksSettings) -> list[Group]:
    groups = group_blobs(views, CANDIDATES * settings.max_lamps)
    least = needed(max((g.score for g in groups), default=-math.inf))
    lamps = [g for g in groups if g.score >= least]
    if not lamps:
        raise LuxError(
            f"no lamp was found in {len(views)} views: nothing glows like one; give masks named "
            "NNNN_LL.png (view, lamp) in a folder instead, white on black."
        )
    lamps = merge_pieces(lamps, views)[: settings.max_lamps]
    add_pieces(lamps, views)
    return lamps


def _masks(capture: Capture, group: Group, views: list[ViewBlobs]) -> dict[int, Mask]:
    """The lamp's mask in every view that shows it, found as a region or grown from its place."""
    masks: dict[int, Mask] = {}
    for view, members in sorted(group.members.items()):
        camera = views[view].camera
        pieces = [full_mask(views[view].blobs[i], camera.height, camera.width) for i in members]
        masks[view] = np.logical_or.reduce(pieces)
    size = extent(group, views)
    levels = [_level(capture, view, mask) for view, mask in masks.items()]
    for view, frame in enumerate(capture.frames):
        if view not in masks:
            photo = read_photo(frame.image_path)
            grown = grow_mask(photo, frame.camera, group.place, size, float(np.median(levels)))
            if grown is not None:
                masks[view] = grown
    return dict(sorted(masks.items()))


def _level(capture: Capture, view: int, mask: Mask) -> float:
    """Median brightness (mean of the display channels) of the lamp in a view."""
    return float(np.median(read_photo(capture.frames[view].image_path).mean(axis=2)[mask]))
