"""A scene as the capture of a room in another light: rendered photos, cameras, points."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from luxcore.cameras import Camera
from luxcore.capture import Capture, Points, View, write_capture
from luxcore.light.agx import agx
from luxcore.splats.gaussians import color_from_sh
from luxcore.splats.relighting import LampSetting, MovingCamera, baked_gaussians
from luxcore.splats.scene import Scene


def relit_capture(
    folder: Path,
    scene: Scene,
    cameras: list[Camera],
    settings: Mapping[str, LampSetting],
) -> Capture:
    """Write into `folder` what the scene's cameras would have seen in the light of `settings`.

    Photos are AgX at the scene's exposure; points are the Gaussians' centres.
    """

    def views() -> Iterator[View]:
        moving = MovingCamera(scene)
        for index, camera in enumerate(cameras):
            shown = agx(scene.tone.exposure * moving.render(camera, settings))
            yield View(f"{index:04d}.png", np.asarray(shown), camera)

    baked = baked_gaussians(scene, settings)
    colors = np.round(255 * color_from_sh(baked.sh).clip(0, 1)).astype(np.uint8)
    return write_capture(
        folder,
        "relit",
        views(),
        Points(baked.means, colors),
        source="rendered",
        metric=scene.metric,
        exposure=scene.tone.exposure,
    )
