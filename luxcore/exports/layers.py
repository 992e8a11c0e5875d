"""One view of a scene as a multi-part EXR: the linear light of every lamp by itself."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from luxcore.cameras import Camera
from luxcore.files.exr import write_exr
from luxcore.splats.light_views import AMBIENT
from luxcore.splats.relighting import LampSetting, MovingCamera
from luxcore.splats.scene import Scene


def write_layers(
    path: Path, scene: Scene, camera: Camera, settings: Mapping[str, LampSetting]
) -> list[str]:
    """One float32 part per light, named as the lamp; returns the names.

    A lamp shines as in the photos, or as `settings` say; one that was off is written as if it were
    on, since a layer of zeros serves nobody. The parts of the lamps that are on add up to the
    picture of `lux relight`.
    """
    moving = MovingCamera(scene)
    names = [AMBIENT, *(lamp.name for lamp in scene.lamps)]
    layers: dict[str, np.ndarray] = {}
    for name in names:
        off = {other: LampSetting(0.0) for other in names}
        layers[name] = moving.render(camera, {**off, name: settings.get(name, LampSetting())})
    write_exr(path, layers, half=False)
    return names
