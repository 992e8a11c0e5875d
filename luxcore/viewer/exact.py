"""Exact pictures: the OpenCL engine blends linear light, then the image is tone-mapped."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from luxcore.cameras import Camera
from luxcore.files.atomic import atomic_file
from luxcore.files.photos import write_png
from luxcore.splats.relighting import MovingCamera
from luxcore.splats.scene import Scene
from luxcore.viewer.colours import tone_map
from luxcore.viewer.lighting import Lighting, lamp_settings, light_names


@dataclass(frozen=True)
class Shot:
    """A camera and the lighting it sees."""

    camera: Camera
    lighting: Lighting


class ExactRenderer:
    """Holds the scene on the device; threads take turns, picture by picture."""

    def __init__(self, scene: Scene) -> None:
        self._names = light_names(scene)
        self._exposure = scene.tone.exposure
        self._camera = MovingCamera(scene)
        self._turn = threading.Lock()

    def linear(self, shot: Shot) -> Float[np.ndarray, "h w 3"]:
        """Linear radiance, before exposure."""
        with self._turn:
            return self._camera.render(shot.camera, lamp_settings(self._names, shot.lighting))

    def display(self, shot: Shot) -> Float[np.ndarray, "h w 3"]:
        """What a screen shows, 0..1."""
        gain = self._exposure * 2.0**shot.lighting.exposure_ev
        return tone_map(self.linear(shot), gain, shot.lighting.tone)


class FilmStoppedError(Exception):
    """Somebody asked for another film, or for none."""


def write_film(
    folder: Path,
    renderer: ExactRenderer,
    shots: Sequence[Shot],
    fps: int,
    is_current: Callable[[], bool],
    tell: Callable[[int], None] = lambda done: None,
) -> Path:
    """Write `folder`/0000.png … and film.mp4 (H.264); returns the film.

    `tell` is called with the number of pictures done. Raises FilmStoppedError once `is_current()`
    is False: the pictures so far stay, no film is made.
    """
    import imageio.v2 as imageio

    # H.264 wants even sides; imageio's default block of 16 would rescale the pictures.
    options: dict[str, Any] = {"fps": fps, "quality": 8, "macro_block_size": 2}
    with (
        atomic_file(folder / "film.mp4") as temporary,
        imageio.get_writer(temporary, **options) as film,
    ):
        for index, shot in enumerate(shots):
            tell(index)
            if not is_current():
                raise FilmStoppedError
            image = np.round(np.clip(renderer.display(shot), 0, 1) * 255).astype(np.uint8)
            write_png(folder / f"{index:04d}.png", image)
            film.append_data(image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2])  # type: ignore[attr-defined]
    return folder / "film.mp4"
